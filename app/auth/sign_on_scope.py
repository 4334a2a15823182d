"""What is asked of a provider of single sign-on (oidc.py), unless configured otherwise; without the database, for a command's help."""

SCOPE = "openid profile"
