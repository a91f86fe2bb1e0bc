"""The steps of estimator and controller: state and event in, messages out, without a clock or a socket."""
