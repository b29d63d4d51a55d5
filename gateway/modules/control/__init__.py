"""The control module: leases, parameters, writes, trials, and what a device stores."""
