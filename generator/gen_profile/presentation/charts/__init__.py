"""Pictures of results: neutral figures, drawn by Matplotlib or Plotly."""
