"""What photographs of patients' hands on the printed sheet told."""
