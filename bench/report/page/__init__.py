"""A run as one offline HTML page, and its summary in a notebook."""
