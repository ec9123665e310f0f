"""A machine with standard messages: any message to the inputs of the estimator, several actuators in one process."""
