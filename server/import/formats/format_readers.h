// The readers of all formats except DICOM and pictures.
#pragma once

#include "server/import/source/reader.h"

namespace isomesh::import {

// Raw samples, described by the task's options. Throws Error kInvalidParameter if the description
// is invalid or does not match the body's size.
extern const Reader kRawReader;

// NIfTI-1, NIfTI-2 and Analyze 7.5 (https://nifti.nimh.nih.gov/nifti-1, /nifti-2), attached to the
// samples or with an image file (.img) beside it.
//
// ITK 5.2 is not the reference: it reads no NIfTI-2, crashes on small 5-D files, does not apply the
// spatial unit to the origin and the directions, silently uses the qform if the sform is sheared or
// far from the origin, and converts 32-bit integers with a slope to float.
//
// The geometry is that of the sform, with its shear, otherwise that of the qform; the options may
// select either. A note reports forms that differ by more than a hundredth of a voxel, another one
// steps of the sform that differ from the voxel sizes in `pixdim`. Without either form the first
// sample is at (0,0,0) and the axes are those of LPS, as in ITK; Analyze 7.5 is placed as in
// nibabel, with a note.
extern const Reader kNiftiReader;

// NRRD (https://teem.sourceforge.net/nrrd/format.html), attached or detached. Volumes may differ
// along a list or time; nrrd_space.h reads the geometry.
extern const Reader kNrrdReader;

// MetaImage (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached or detached. The space is
// LPS, as in all programs that write MetaImage. Ignores AnatomicalOrientation and CenterOfRotation,
// which do not affect the samples' positions. Applies the samples' slope and offset, with a note.
extern const Reader kMetaImageReader;

// VTK's XML image data, .vti (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
// Knows all of VTK's XML files, and rejects those without an image with the reason. The samples are
// the scalars, of one component, in one piece that fills the whole extent: of the point data, or,
// if there are none, of the cell data at the cells' centres. Without named scalars, volumes are the
// arrays of one component. VTK does not define its space's relation to the patient; LPS is assumed,
// as programs based on ITK write it.
extern const Reader kVtiReader;

// Structured points in VTK's legacy format, .vtk (same page). Finds files, scalars and space as
// kVtiReader does.
extern const Reader kVtkLegacyReader;

// FreeSurfer's MGH volumes, .mgh and .mgz
// (https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat). Volumes are frames. The
// direction cosines and the centre place the samples (vox2ras); without them FreeSurfer's coronal
// axes are assumed, with a note. Ignores the tags behind the samples.
extern const Reader kMghReader;

// AFNI datasets: a header .HEAD with its samples in .BRIK, maybe compressed
// (https://afni.nimh.nih.gov/pub/dist/doc/program_help/README.attributes.html). Volumes are
// sub-bricks, whose factor is applied. IJK_TO_DICOM_REAL places the samples, otherwise
// ORIENT_SPECIFIC, ORIGIN and DELTA; AFNI's coordinates are LPS.
extern const Reader kAfniReader;

// Philips' PAR/REC: a header .PAR with its samples in .REC. Versions 4, 4.1 and 4.2. Volumes are
// echoes, instants, phases, types or diffusion weights. Samples are the displayed values (DV = PV *
// RS + RI). The geometry is that of nibabel: from the angulation and the centre of the whole stack.
extern const Reader kParReader;

// Scanco's ISQ images of micro-CT. Samples stay as stored, neither density nor Hounsfield units;
// the first slice lies at its position in the scanner.
extern const Reader kIsqReader;

// MRC2014 and CCP4 maps, .mrc and .map (https://www.ccpem.ac.uk/mrc_format/mrc2014.php). Several
// volumes are a stack (space group 401); stacks of images are rejected. Coordinates stay in
// angstrom, with a note. Sections are ordered by the axes that the header names; cell angles shear
// the lattice. The origin is ORIGIN, or, if that is zero, the position of the first sample in the
// cell (NXSTART ...).
extern const Reader kMrcReader;

// Gaussian cube files (https://gaussian.com/cubegen/). Volumes are values or orbitals at the
// points. Recognised by the numbers behind the two lines of comment. Skips the atoms. Coordinates
// become angstrom, with a note.
extern const Reader kCubeReader;

// NumPy's arrays, .npy (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html). An
// .npz is a ZIP of them; arrays without three or four axes of numbers are no volumes beside others.
// The last three axes are z, y and x, as in SimpleITK, nnU-Net and PyTorch, in either memory order;
// a first of four axes holds several volumes. An array has neither a spacing nor a position.
extern const Reader kNumpyReader;

// GIPL, .gipl (the layout is that of ITK's reader). Volumes are along the fourth axis. The file
// gives an origin and no directions.
extern const Reader kGiplReader;

// MRtrix' images, .mif, and .mih with data files
// (https://mrtrix.readthedocs.io/en/latest/getting_started/image_data.html). Volumes are along the
// fourth axis. Reversed axes begin at their other end, so samples stay as they are stored.
extern const Reader kMifReader;

// OME-Zarr 0.4 and 0.5, and older ones (https://ngff.openmicroscopy.org), as a folder or archive.
// The header is the metadata of a group with `multiscales`; its first dataset is read, which has
// the full resolution. Volumes are times and channels. See zarr_array.h for what is decoded.
extern const Reader kZarrReader;

// Images in HDF5: those of ITK and MINC 2 (https://en.wikibooks.org/wiki/MINC/Reference). Volumes
// are instants. MINC's integers become real values by the range of each slice; they stay integers
// if that changes nothing. Throws Error kUnsupportedMedia for HDF5 files of other programs. The
// position of the samples in the file is unknown, so its size has the limit of any volume.
extern const Reader kHdf5Reader;

}  // namespace isomesh::import
