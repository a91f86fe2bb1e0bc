"""Systems of others at both ends of the wire: motion captures that come in, and clients that are served."""
