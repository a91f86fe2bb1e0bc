"""A log through the same steps again, our own or a foreign one."""
