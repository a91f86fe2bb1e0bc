"""The lab that is not there: robots and motion capture."""
