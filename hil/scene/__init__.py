"""What a lab looks like in a 3D panel: transforms and markers."""
