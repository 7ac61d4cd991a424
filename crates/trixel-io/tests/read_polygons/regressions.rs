//! Inputs that once went wrong, by what they did.
