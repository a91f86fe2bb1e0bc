"""Reports as web pages: one file each, opened by double click, complete without a network."""
