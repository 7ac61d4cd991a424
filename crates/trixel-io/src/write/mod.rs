//! Volume writers: one file a format.
