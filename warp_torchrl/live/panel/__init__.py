"""One person's controls on the page: a module for each tab, and ``panel`` with what stands above them."""
