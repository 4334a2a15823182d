"""Analysis from Python: what `import handscope` offers (docs/measures.md)."""
