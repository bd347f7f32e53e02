"""A run as a page: all of it in one offline file, and its summary in a notebook."""
