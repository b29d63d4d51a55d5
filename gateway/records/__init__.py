"""What must outlive the process: the journal, the held stop, and the writes that are to be taken back."""
