//! File sets read back the way each engine reads them.

mod engines;
mod mistakes;
mod readers;
mod synthetic;
