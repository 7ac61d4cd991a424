//! Volume readers.
