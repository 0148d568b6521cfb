"""The dashboard: a Streamlit face over the library."""
