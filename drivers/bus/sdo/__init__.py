"""SDO: transfers over one channel to one node, one after another, errors in words (CiA 301 §7.2.4)."""
