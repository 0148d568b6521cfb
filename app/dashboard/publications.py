"""The figures of three publications beside the models' own, each statement judged by numbers."""

from __future__ import annotations

import streamlit as st

from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import show_figure
from app.papers import PAPERS, Paper, paper


@st.cache_resource(max_entries=3, show_spinner="Computing every figure: one to two minutes …")
def computed(name: str) -> Paper:
    """Return the figures of a publication, done once."""
    return paper(name)


def show_publications() -> None:
    """Choose a publication; its figures are computed when asked for."""
    name = st.selectbox("Publication", list(PAPERS), format_func=PAPERS.__getitem__, key="publication")
    if not st.toggle("Compute its figures", key=f"publication {name} wanted"):
        st.caption(f"Takes one to two minutes, once. The same as files: `gearsig papers {name} -o out`.")
        return
    found = computed(name)
    st.markdown(f"**{found.summary}** {as_typed(found.source)}")
    for item in found.figures:
        st.subheader(f"{item.answers}: {item.title}")
        show_figure(item.figure, item.title, f"publication {name} {item.answers}")
        rows = [
            {"the publication says": c.statement, "the model gives": c.found, "verdict": c.judgement}
            for c in item.claims
        ]
        if rows:
            st.dataframe(rows, hide_index=True, width="stretch")
    if found.unanswered:
        st.subheader("Figures without an answer")
        st.dataframe(
            [{"figure": figure, "why": why} for figure, why in found.unanswered.items()],
            hide_index=True,
            width="stretch",
        )
