"""The report to take away."""

from __future__ import annotations

import streamlit as st

from app.dashboard.cached import command_of, report_page
from app.dashboard.state import Request
from app.dashboard.uploads import safe_file_name
from gearsig.diagnosis.types import Analysis


def show_report(analysis: Analysis, request: Request) -> None:
    """Offer the page that `gearsig report` writes, and the command that repeats the analysis."""
    st.markdown(
        "One self-contained HTML page: verdict, findings, figures, indicators, and where everything came from. "
        "It opens without a network and holds no scripts."
    )
    st.download_button(
        "Download the report",
        data=lambda: report_page(request, analysis),
        file_name=f"{safe_file_name(request.name).split('.')[0] or 'recording'}.html",
        mime="text/html",
        on_click="ignore",
        type="primary",
        icon=":material/download:",
    )
    st.markdown("The same diagnosis from the command line:")
    st.code(command_of(request), language="bash", wrap_lines=True)
    if request.rig_text.strip():
        st.download_button(
            "Download the rig file, with what was changed here",
            request.rig_text,
            file_name=f"{safe_file_name(request.rig_name).removesuffix('.toml')}.toml",
            mime="application/toml",
            on_click="ignore",
            icon=":material/download:",
        )
    _show_provenance(analysis)


def _show_provenance(analysis: Analysis) -> None:
    recording = analysis.recording
    rows = [
        ("file", recording.provenance.source),
        ("SHA-256", recording.provenance.sha256),
        ("reader", recording.provenance.reader),
        *((f"step {i}", step) for i, step in enumerate(recording.provenance.history, 1)),
        *((name, str(value)) for name, value in analysis.settings.items()),
    ]
    table = {"provenance": [name for name, _ in rows], "": [text for _, text in rows]}
    config = {"provenance": st.column_config.TextColumn(width="small"), "": st.column_config.TextColumn(width="large")}
    st.dataframe(table, hide_index=True, width="stretch", column_config=config)
