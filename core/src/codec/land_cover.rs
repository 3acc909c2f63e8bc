//! Land-cover tiles. See the module's tests for the exact codes.
