mod furnace;
mod peers;
