// The readers of all formats except DICOM and pictures; readers.cpp has the table. For each format:
//
// is_X recognises the beginning of a file.
//
// parse_X reads the header and places the samples; the options select one of several volumes.
// Throws Error kUnusableVolume.
//
// most_X_bytes limits the size of a file by the header at its beginning. Throws as parse_X does,
// and Error kTooLarge beyond the limits. Formats without it have nothing behind their samples.
//
// X_data_names names the data files of a detached header.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Raw samples, described by the task's options. Throws Error kInvalidParameter if the description
// is invalid or does not match the body's size; otherwise as import_volume does.
Volume parse_raw(const Input& input);

// NIfTI-1, NIfTI-2 and Analyze 7.5 (https://nifti.nimh.nih.gov/nifti-1, /nifti-2), attached to the
// samples or with an image file (.img) beside it.
//
// ITK 5.2 is not the reference: it reads no NIfTI-2, crashes on small 5-D files, does not apply the
// spatial unit to the origin and the directions, silently uses the qform if the sform is sheared or
// far from the origin, and converts 32-bit integers with a slope to float.
bool is_nifti(std::string_view head);
// The payload's size stays 0, because the header does not have it.
//
// The geometry is that of the sform, with its shear, otherwise that of the qform; the options may
// select either. A note reports forms that differ by more than a hundredth of a voxel, another one
// steps of the sform that differ from the voxel sizes in `pixdim`. Without either form the first
// sample is at (0,0,0) and the axes are those of LPS, as in ITK; Analyze 7.5 is placed as in
// nibabel, with a note.
SourceVolume parse_nifti(const InputFile& file, const Companions& companions,
                         const ImportOptions& options);
std::vector<std::string> nifti_data_names(const InputFile& file, const Companions& companions);
MostBytes most_nifti_bytes(const InputFile& beginning, const ImportTask& task);

// NRRD (https://teem.sourceforge.net/nrrd/format.html), attached or detached. Volumes may differ
// along a list or time; nrrd_space.h reads the geometry.
bool is_nrrd(std::string_view head);
SourceVolume parse_nrrd(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);
std::vector<std::string> nrrd_data_names(const InputFile& file, const Companions& companions);
MostBytes most_nrrd_bytes(const InputFile& beginning, const ImportTask& task);

// MetaImage (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached or detached.
bool is_metaimage(std::string_view head);
// The space is LPS, as in all programs that write MetaImage. Ignores AnatomicalOrientation and
// CenterOfRotation, which do not affect the samples' positions. Applies the samples' slope and
// offset, with a note.
SourceVolume parse_metaimage(const InputFile& file, const Companions& companions,
                             const ImportOptions& options);
std::vector<std::string> metaimage_data_names(const InputFile& file, const Companions& companions);
MostBytes most_metaimage_bytes(const InputFile& beginning, const ImportTask& task);

// VTK's XML image data, .vti (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
// True for all of VTK's XML files; files without an image are rejected later, with the reason.
bool is_vti(std::string_view head);
// True if such a file may hold an image, by its beginning.
bool may_hold_image(std::string_view head);
// Reads the XML up to the samples. They are the scalars, of one component, in one piece that fills
// the whole extent: of the point data, or, if there are none, of the cell data at the cells'
// centres. Without named scalars, volumes are the arrays of one component. VTK does not define its
// space's relation to the patient; LPS is assumed, as programs based on ITK write it.
SourceVolume parse_vti(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);
// By the image's extent, with room for further arrays. Fails if the beginning does not have it.
MostBytes most_vti_bytes(const InputFile& beginning, const ImportTask& task);

// Structured points in VTK's legacy format, .vtk (same page). True for all files of that format;
// those without an image are rejected later, with the reason.
bool is_vtk_legacy(std::string_view head);
// True if such a file may hold an image, by its beginning.
bool may_hold_structured_points(std::string_view head);
// Finds the scalars as parse_vti does, and assumes the same space.
SourceVolume parse_vtk_legacy(const InputFile& file, const Companions& companions,
                              const ImportOptions& options);
MostBytes most_vtk_legacy_bytes(const InputFile& beginning, const ImportTask& task);

// FreeSurfer's MGH volumes, .mgh and .mgz
// (https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat). Volumes are frames.
bool is_mgh(std::string_view head);
// The direction cosines and the centre place the samples (vox2ras); without them FreeSurfer's
// coronal axes are assumed, with a note. Ignores the tags behind the samples.
SourceVolume parse_mgh(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// AFNI datasets: a header .HEAD with its samples in .BRIK, maybe compressed
// (https://afni.nimh.nih.gov/pub/dist/doc/program_help/README.attributes.html). Volumes are
// sub-bricks, whose factor is applied.
bool is_afni(std::string_view head);
// IJK_TO_DICOM_REAL places the samples, otherwise ORIENT_SPECIFIC, ORIGIN and DELTA; AFNI's
// coordinates are LPS.
SourceVolume parse_afni(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);
std::vector<std::string> afni_data_names(const InputFile& file, const Companions& companions);
MostBytes most_afni_bytes(const InputFile& beginning, const ImportTask& task);

// Philips' PAR/REC: a header .PAR with its samples in .REC. Versions 4, 4.1 and 4.2. Volumes are
// echoes, instants, phases, types or diffusion weights.
bool is_par(std::string_view head);
// Samples are the displayed values (DV = PV * RS + RI). The geometry is that of nibabel: from the
// angulation and the centre of the whole stack.
SourceVolume parse_par(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);
std::vector<std::string> par_data_names(const InputFile& file, const Companions& companions);
MostBytes most_par_bytes(const InputFile& beginning, const ImportTask& task);

// Scanco's ISQ images of micro-CT.
bool is_isq(std::string_view head);
// Samples stay as stored, neither density nor Hounsfield units; the first slice lies at its
// position in the scanner.
SourceVolume parse_isq(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// MRC2014 and CCP4 maps, .mrc and .map (https://www.ccpem.ac.uk/mrc_format/mrc2014.php). Several
// volumes are a stack (space group 401); stacks of images are rejected.
bool is_mrc(std::string_view head);
// Coordinates stay in angstrom, with a note. Sections are ordered by the axes that the header
// names; cell angles shear the lattice. The origin is ORIGIN, or, if that is zero, the position of
// the first sample in the cell (NXSTART ...).
SourceVolume parse_mrc(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

// Gaussian cube files (https://gaussian.com/cubegen/). Volumes are values or orbitals at the
// points. Recognised by the numbers behind the two lines of comment.
bool is_cube(std::string_view head);
// Skips the atoms. Coordinates become angstrom, with a note.
SourceVolume parse_cube(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);

// NumPy's arrays, .npy (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html). An
// .npz is a ZIP of them.
bool is_numpy(std::string_view head);
// True if the array has three or four axes of numbers. Other arrays beside it in an .npz are no
// volumes.
bool may_hold_numpy_volume(std::string_view head);
// The last three axes are z, y and x, as in SimpleITK, nnU-Net and PyTorch, in either memory order;
// a first of four axes holds several volumes. An array has neither a spacing nor a position.
SourceVolume parse_numpy(const InputFile& file, const Companions& companions,
                         const ImportOptions& options);

// Images in HDF5: those of ITK and MINC 2 (https://en.wikibooks.org/wiki/MINC/Reference). Volumes
// are instants.
bool is_hdf5(std::string_view head);
// Reads the image and writes the task's target. MINC's integers become real values by the range of
// each slice; they stay integers if that changes nothing. Throws as import_volume does; Error
// kUnsupportedMedia for HDF5 files of other programs.
Volume parse_hdf5(const Input& input);
// The position of the samples in the file is unknown, so this is the limit for any volume.
MostBytes most_hdf5_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
