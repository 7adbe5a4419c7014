//! A worker and nothing else: the child that tests give bad input to. `kiln` starts itself as one.

fn main() -> std::io::Result<()> {
    kiln_worker::serve()
}
