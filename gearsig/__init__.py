"""gearsig: signal processing and diagnostics for gear vibration, simulated and measured."""

__version__ = "0.1.0"
