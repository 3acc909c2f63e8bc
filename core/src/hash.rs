//! Integer hashes and the minimal standard generator: the same on server, CPU and GPU.
