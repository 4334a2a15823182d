"""A glove at the port of the clinician's own browser: its bytes come over a web socket."""
