# Each target sets up what it needs first; scripts/ does the work.
.PHONY: help demo test test-all test-arm bench fuzz wheel wheel-arm lint docs format clean

help:  ## List the targets
	@sed -n 's/^\([a-z-]*\):  ## /\1\t/p' Makefile | expand -t 12

demo:  ## Let a robot map a room and keep the map up to date for a day of changes, in demo
	@scripts/demo

test:  ## Build, then run the C++ tests, the unit tests and a system test of each stage
	@scripts/test

test-all:  ## Build, then run all C++ and Python tests
	@scripts/test all

test-arm:  ## Cross-compile the C++ tests for 64-bit ARM and run them under QEMU
	@scripts/setup arm
	@scripts/ctest arm64

bench:  ## Build and run the benchmarks
	@scripts/bench

fuzz:  ## Feed the PLY reader malformed files for 10 minutes
	@scripts/fuzz

wheel:  ## Build a wheel that needs nothing but Python, in dist, and test it in a Debian of its own
	@scripts/wheel

wheel-arm:  ## Cross-compile a wheel for 64-bit ARM, in dist/aarch64, and test it under QEMU
	@scripts/wheel python3 aarch64

lint:  ## Check formatting, style, types, layers, docstrings, stubs and documents
	@scripts/lint

docs:  ## Build the documentation site, build/site/index.html
	@scripts/docs

format:  ## Format the sources and regenerate the stubs
	@scripts/lint --fix

clean:  ## Remove what was built
	rm -rf build dist docs/api out .venv/gslts-stamp
