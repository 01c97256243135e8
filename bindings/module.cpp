#include <pybind11/pybind11.h>

namespace gslts::python {
void define_align(pybind11::module_ m);
void define_detect(pybind11::module_ m);
void define_edit(pybind11::module_ m);
void define_fusion(pybind11::module_ m);
void define_io(pybind11::module_ m);
void define_map(pybind11::module_ m);
void define_optim_adam(pybind11::module_ m);
void define_optim_losses(pybind11::module_ m);
void define_plan(pybind11::module_ m);
void define_raster(pybind11::module_ m);
void define_reloc(pybind11::module_ m);
void define_reloc_clouds(pybind11::module_ m);
void define_reloc_refine(pybind11::module_ m);
void define_sim(pybind11::module_ m);
void define_simd(pybind11::module_ m);
}  // namespace gslts::python

// Each library has the submodule of its name. std::invalid_argument arrives in Python as
// ValueError, std::bad_alloc as MemoryError, and every other standard exception as RuntimeError:
// pybind11's own translation.
PYBIND11_MODULE(_core, m) {
  namespace python = gslts::python;
  m.doc() = "C++ core of gslts: strict and thin; the package gslts is its public face.";
  // Types come before what uses them, so that signatures name them.
  python::define_simd(m.def_submodule("simd", "Instruction set of the kernels."));
  python::define_map(m.def_submodule("map", "Cameras and views of Gaussians."));
  python::define_io(m.def_submodule("io", "PLY files of maps."));
  python::define_fusion(m.def_submodule("fusion", "Fusion and registration of depth images."));
  python::define_raster(m.def_submodule("raster", "Rendering and its gradients."));
  pybind11::module_ optim = m.def_submodule("optim", "Adam, and losses of images.");
  python::define_optim_adam(optim);
  python::define_optim_losses(optim);
  python::define_align(m.def_submodule("align", "Direct image alignment."));
  python::define_detect(m.def_submodule("detect", "Changes between map and frame."));
  python::define_edit(
      m.def_submodule("edit", "Selection and creation of Gaussians of an edited map."));
  python::define_plan(m.def_submodule("plan", "Shortest paths over a grid."));
  pybind11::module_ reloc = m.def_submodule("reloc", "Pose of an image in a map, without a prior.");
  python::define_reloc(reloc);
  python::define_reloc_clouds(reloc);
  python::define_reloc_refine(reloc);
  python::define_sim(m.def_submodule("sim", "Shading of simulated RGB-D frames."));
}
