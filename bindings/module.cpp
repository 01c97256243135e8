#include <pybind11/pybind11.h>

namespace gslts::python {
void define_adam(pybind11::module_ m);
void define_alignment(pybind11::module_ m);
void define_detect(pybind11::module_ m);
void define_edit(pybind11::module_ m);
void define_losses(pybind11::module_ m);
void define_map(pybind11::module_ m);
void define_ply(pybind11::module_ m);
void define_raster(pybind11::module_ m);
void define_reloc(pybind11::module_ m);
void define_reloc_clouds(pybind11::module_ m);
void define_reloc_refine(pybind11::module_ m);
void define_sim(pybind11::module_ m);
void define_surface_voxels(pybind11::module_ m);
}  // namespace gslts::python

// std::invalid_argument arrives in Python as ValueError, std::bad_alloc as MemoryError, and every
// other standard exception as RuntimeError: pybind11's own translation.
PYBIND11_MODULE(_core, m) {
  m.doc() = "C++ core of gslts: strict and thin; the package gslts is its public face.";
  pybind11::module_ map = m.def_submodule("map", "Cameras, views of Gaussians and their files.");
  gslts::python::define_map(map);
  gslts::python::define_ply(map);
  gslts::python::define_surface_voxels(map);
  pybind11::module_ raster = m.def_submodule("raster", "Rendering, losses and their gradients.");
  gslts::python::define_raster(raster);
  gslts::python::define_losses(raster);
  gslts::python::define_adam(raster);
  gslts::python::define_alignment(raster);
  gslts::python::define_detect(m.def_submodule("detect", "What changed between map and frame."));
  gslts::python::define_edit(m.def_submodule("edit", "Which Gaussians go, and which come."));
  pybind11::module_ reloc = m.def_submodule("reloc", "Where in a map a picture was taken.");
  gslts::python::define_reloc(reloc);
  gslts::python::define_reloc_clouds(reloc);
  gslts::python::define_reloc_refine(reloc);
  gslts::python::define_sim(m.def_submodule("sim", "Shading of simulated RGB-D frames."));
}
