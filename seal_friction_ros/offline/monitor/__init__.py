"""The view of estimators, live or of a bag: numbers and words of each actuator, and the web page that shows them."""
