include_guard()

# FLANN's exact k-d tree is all in its headers; these also name LZ4, with which FLANN would save an
# index.
gslts_external(flann HEADER flann/flann.hpp LIBRARIES lz4)
