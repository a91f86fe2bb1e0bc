"""The commands of ``abreast``, one module each, loaded when called."""
