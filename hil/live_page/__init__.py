"""The page that shows a lab in a browser while it drives, and stops it."""
