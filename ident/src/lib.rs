//! ident
#![forbid(unsafe_code)]
