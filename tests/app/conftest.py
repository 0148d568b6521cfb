"""Settings of the tests of the app."""

from functools import cache

from streamlit.components.v2 import manifest_scanner

# Streamlit looks through all installed packages for components, once for each page that a test opens.
manifest_scanner.scan_component_manifests = cache(manifest_scanner.scan_component_manifests)
