"""Who may log in: accounts and logins of browsers, tries counted."""
