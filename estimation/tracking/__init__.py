"""From frames to an estimate: screening, gate, re-acquisition, late frames, prediction, smoothing."""
