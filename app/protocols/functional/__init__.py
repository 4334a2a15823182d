"""The movements of a functional calibration, a JSON file each, in the form of app/protocols."""
