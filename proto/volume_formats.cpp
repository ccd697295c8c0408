#include "proto/volume_formats.h"

#include <algorithm>

#include "proto/error.h"

namespace isomesh {
namespace {

constexpr VolumeFormat kVolumeFormats[] = {
    {.name = "nifti",
     .title = "NIfTI",
     .suffixes = ".nii .nii.gz .hdr .img",
     .content = "NIfTI-1 and NIfTI-2, also as pairs of `.hdr` and `.img`; Analyze 7.5"},
    {.name = "nrrd",
     .title = "NRRD",
     .suffixes = ".nrrd .nhdr",
     .content = "one file, or a header with its data files; also compressed by bzip2"},
    {.name = "metaimage",
     .title = "MetaImage",
     .suffixes = ".mha .mhd",
     .content = "one file, or a header with its data files"},
    {.name = "vti",
     .title = "VTI",
     .suffixes = ".vti",
     .content = "images of VTK's XML format with point data, or with cell data only; `volume=N` "
                "chooses an array"},
    {.name = "vtk",
     .title = "VTK",
     .suffixes = ".vtk",
     .content = "structured points in VTK's legacy format with point data, or with cell data only; "
                "`volume=N` chooses an array"},
    {.name = "mgh",
     .title = "MGH",
     .suffixes = ".mgh .mgz",
     .content = "volumes of FreeSurfer; `volume=N` chooses a frame"},
    {.name = "afni",
     .title = "AFNI",
     .suffixes = ".HEAD .BRIK .BRIK.gz",
     .content =
         "the `.HEAD` with its `.BRIK`, which may be compressed; `volume=N` chooses a sub-brick"},
    {.name = "par",
     .title = "PAR/REC",
     .suffixes = ".PAR .REC",
     .content =
         "Philips' `.PAR` of version 4, 4.1 or 4.2 with its `.REC`; `volume=N` chooses an echo, "
         "instant, phase, type or diffusion weight"},
    {.name = "isq",
     .title = "Scanco ISQ",
     .suffixes = ".isq",
     .content = "micro-CT of Scanco; samples stay as stored, neither density nor Hounsfield units"},
    {.name = "mrc",
     .title = "MRC",
     .suffixes = ".mrc .map .ccp4 .rec",
     .content = "MRC2014 and CCP4 maps of modes 0, 1, 2, 6 and 12, in angstrom"},
    {.name = "cube",
     .title = "Gaussian cube",
     .suffixes = ".cube .cub",
     .content = "in angstrom; `volume=N` chooses an orbital or value"},
    {.name = "numpy",
     .title = "NumPy",
     .suffixes = ".npy .npz",
     .content = "arrays with the axes z, y and x in C or Fortran order; a first of four axes holds "
                "several volumes; needs `spacing`"},
    {.name = "gipl",
     .title = "GIPL",
     .suffixes = ".gipl .gipl.gz",
     .content = "integers of 8 to 32 bits and floats; `volume=N` chooses a frame"},
    {.name = "mif",
     .title = "MIF",
     .suffixes = ".mif .mif.gz .mih",
     .content = "images of MRtrix, all types except complex numbers; `volume=N` chooses along the "
                "fourth axis"},
    {.name = "zarr",
     .title = "OME-Zarr",
     .suffixes = ".zarr",
     .content = "a folder, ZIP or TAR of OME-Zarr 0.4 or 0.5 at full resolution, also its labels "
                "with their colours; chunks of Blosc, Zstandard, gzip or zlib, also in shards; "
                "`volume=N` chooses a channel or time"},
    {.name = "hdf5",
     .title = "HDF5",
     .suffixes = ".h5 .hdf5 .mnc .mnc2",
     .content = "images of ITK, and MINC 2; MINC's integers become real values"},
    {.name = "tiff",
     .title = "TIFF",
     .suffixes = ".tif .tiff .btf .tf8 .lsm",
     .content =
         "several pages, or a folder or archive of single pages; OME-TIFF and ImageJ's TIFF with "
         "their spacing, ImageJ's with calibrated values, both also in folders; Zeiss LSM of one "
         "channel with its spacing; others need `spacing`; `volume=N` chooses a channel or time; "
         "strips and tiles, BigTIFF, integers of 1 to 64 bits, floats, palettes and grey colours, "
         "compressed without loss"},
    {.name = "png",
     .title = "PNG",
     .suffixes = ".png",
     .content =
         "a folder or archive of images: grey of 1 to 16 bits, indices of a palette, or colours "
         "that are grey; needs `spacing`"},
    {.name = "bmp",
     .title = "BMP",
     .suffixes = ".bmp",
     .content =
         "a folder or archive of images: indices of a palette, or colours that are grey; needs "
         "`spacing`"},
    {.name = "dicom",
     .title = "DICOM",
     .suffixes = ".dcm .ima",
     .content = "a series of single slices, or one multi-frame file; see below"},
    {.name = "raw",
     .title = "raw samples",
     .suffixes = ".raw",
     .content = "need their dimensions and type; see [below](#raw-samples)"},
};

}  // namespace

std::span<const VolumeFormat> volume_formats() { return kVolumeFormats; }

const VolumeFormat& volume_format(std::string_view name) {
  const auto* found = std::ranges::find(kVolumeFormats, name, &VolumeFormat::name);
  if (found != std::end(kVolumeFormats)) return *found;
  throw Error(ErrorCode::kInternal, "There is no volume format " + std::string(name) + ".");
}

std::string volume_format_titles() {
  std::string titles;
  const auto listed = volume_formats().first(volume_formats().size() - 1);
  for (const VolumeFormat& format : listed) {
    if (!titles.empty()) titles += &format == &listed.back() ? " or " : ", ";
    titles += format.title;
  }
  return titles;
}

}  // namespace isomesh
