//! Which trees stand where.
