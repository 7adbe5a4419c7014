#error in the include
