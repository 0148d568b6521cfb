"""One file per page; a page arranges widgets and computes nothing."""
