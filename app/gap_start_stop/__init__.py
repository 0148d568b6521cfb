"""The gap diagnosis of machines that start and stop: `gearsig gap --model forging`."""
