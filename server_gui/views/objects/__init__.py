"""The object dictionary of a device: searched, read, compared; what may be written leads to Parameters."""
