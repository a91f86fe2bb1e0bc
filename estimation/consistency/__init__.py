"""Whether an estimator's errors are what they can be at best."""
