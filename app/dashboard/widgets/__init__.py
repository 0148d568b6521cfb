"""One file per widget: a result of the library in, elements of the page out."""
