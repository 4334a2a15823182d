"""The pages: documents, styles, scripts and vendored libraries; no build step."""
