"""Routes by which one logs in: codes and passwords, single sign-on, second factors."""
