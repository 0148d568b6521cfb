"""The page's colours in the terms of Streamlit's settings; imports nothing, so that the command line stays quick."""

DARK_PAPER = "#15171B"
"""Ground of the dark page; figures that are turned over end on it."""

THEME_OPTIONS = (
    "theme.light.primaryColor=#0072B2",
    "theme.dark.primaryColor=#2B86C5",
    f"theme.dark.backgroundColor={DARK_PAPER}",
    "theme.dark.secondaryBackgroundColor=#22262C",
)
