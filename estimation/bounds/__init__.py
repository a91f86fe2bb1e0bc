"""How wrong an estimate can be: error bounds, certified radii, and the certificate."""
