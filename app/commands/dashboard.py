"""`gearsig dashboard`: the Streamlit app on this machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def dashboard(
    port: Annotated[int, typer.Option(help="Port on localhost.")] = 8501,
    browser: Annotated[bool, typer.Option(help="Open a browser window.")] = True,
) -> None:
    """Open the dashboard in a browser. It listens on localhost only and sends nothing anywhere."""
    from streamlit.web import cli as streamlit_cli

    main_page = Path(__file__).parents[1] / "dashboard" / "main.py"
    sys.argv = [
        "streamlit",
        "run",
        str(main_page),
        "--server.address=localhost",
        f"--server.port={port}",
        f"--server.headless={str(not browser).lower()}",
        "--browser.gatherUsageStats=false",
        "--server.maxUploadSize=2000",
    ]
    sys.exit(streamlit_cli.main())
