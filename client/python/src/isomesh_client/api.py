"""The types of the server's requests and responses. `generate` makes this file from openapi.yaml.

The types describe JSON objects and are for type checkers: at run time every response is a plain dict.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Mapping, Optional, Sequence, TypedDict, Union

if TYPE_CHECKING:
    from typing_extensions import NotRequired


#: The suffixes of files of volumes.
VOLUME_SUFFIXES: Sequence[str] = (
    '.BRIK', '.BRIK.gz', '.HEAD', '.PAR', '.REC', '.bmp', '.btf', '.ccp4', '.cub', '.cube',
    '.dcm', '.gipl', '.gipl.gz', '.h5', '.hdf5', '.hdr', '.ima', '.img', '.isq', '.lsm', '.map',
    '.mgh', '.mgz', '.mha', '.mhd', '.mif', '.mif.gz', '.mih', '.mnc', '.mnc2', '.mrc', '.nhdr',
    '.nii', '.nii.gz', '.npy', '.npz', '.nrrd', '.png', '.raw', '.rec', '.tf8', '.tif', '.tiff',
    '.vti', '.vtk', '.zarr',
)
#: The type of one sample.
SampleType = Literal['uint8', 'int8', 'uint16', 'int16', 'uint32', 'int32', 'float32', 'float64']
#: The format and suffix of a mesh file. STL, PLY and VTK are binary. vtk is VTK's legacy
#: format, vtp its XML format, gii GIFTI, usda USD's text, and usdz that text in a package. zip
#: is for labels. It holds one file per label in each other requested format except glb, 3mf,
#: usda and usdz. If there is none, the files are STL.
MeshFormat = Literal['drc', 'glb', 'stl', 'ply', 'obj', '3mf', 'usda', 'usdz', 'off', 'vtk', 'vtp', 'gii', 'zip']
JobState = Literal['queued', 'running', 'succeeded', 'failed', 'cancelled']
Vector = Union['Sequence[float]']


class Volume(TypedDict):
    """A stored volume. The sample (i,j,k) lies at origin + direction * diag(spacing) * (i,j,k),
    in millimetres, in DICOM's patient space (LPS)."""

    #: A digest of what the upload says: the samples and their geometry, patient, modality,
    #: presets, notes, names and colours of labels. So the same upload is the same volume on this
    #: server, whatever its file is called. The same samples with other names of labels, or of
    #: another patient, are another volume. A newer server may say more of a file, and then make
    #: another volume of it.
    id: str
    #: The SHA-256 of the samples and their geometry, which a GLB repeats in asset.extras.samples.
    #: Volumes of the same owner with the same samples share their bytes and, where nothing else
    #: differs in them, their meshes.
    samples: str
    #: The volume's name: at first the one that its upload chose, or that of the series or file,
    #: until the volume is renamed. It is not part of any mesh or of any log. Null if nothing gave
    #: a name.
    name: Optional[str]
    #: The format of the first upload of this volume.
    format: VolumeFormat
    #: The number of samples along x, y and z. These are in the order of the patient, whatever the
    #: order in the file (stored_axes): x increases towards the left, y towards the back, z towards
    #: the head, as nearly as the directions allow.
    dims: Sequence[int]
    type: SampleType
    #: Millimetres between samples along each axis. Along z it is the distance from slice to slice,
    #: even if a tilted gantry shears the slices.
    spacing: Vector
    #: The position of the first sample.
    origin: Vector
    #: Row-major. The columns are the unit vectors of x, y and z. They are perpendicular, except
    #: that a tilted gantry shears z.
    direction: Sequence[float]
    #: The directions in which the first, second and third index of the uploaded file increase, as
    #: letters for right or left, anterior or posterior, superior or inferior: RAS for most NIfTI
    #: files. Volumes of older servers lack it.
    stored_axes: NotRequired[str]
    #: The smallest and the largest sample.
    range: Sequence[float]
    #: Otsu's threshold.
    suggested_iso: float
    #: The size of all samples in bytes.
    bytes: int
    created: str
    #: DICOM's modality, such as CT or MR. Null if unknown.
    modality: Optional[str]
    #: Iso-values for this modality that lie within range. For a CT in Hounsfield units: skin, soft
    #: tissue and bone.
    presets: Sequence[Preset]
    #: Files of the upload that are not part of the volume, at most 100.
    ignored: Sequence[IgnoredObject]
    #: Decisions, corrections and open points from reading the upload. A GLB repeats the notes on
    #: samples and geometry in asset.extras.notes. A job does not reuse a mesh that was made with
    #: other ones of these.
    notes: Sequence[Note]
    dicom: NotRequired[DicomIdentity]


class UploadedVolumesVolumes(TypedDict):
    #: The member of the archive, as the query member takes it.
    member: str
    #: The status as if the member had been uploaded alone: 201, 200 or that of the problem.
    status: int
    #: Null if the member was rejected.
    volume: Optional[Volume]
    #: The reason for the rejection.
    problem: Optional[Problem]


class Note(TypedDict):
    code: NoteCode
    #: What the note means for this volume or mesh, for people.
    detail: str


#: The format of an upload.
VolumeFormat = Literal['nifti', 'nrrd', 'metaimage', 'vti', 'vtk', 'mgh', 'afni', 'par', 'isq', 'mrc', 'cube', 'numpy', 'gipl', 'mif', 'zarr', 'hdf5', 'tiff', 'png', 'bmp', 'dicom', 'raw']
#: A stable name, for programs.
NoteCode = Literal['forms-differ', 'pixdim-differs', 'volume-chosen', 'space-assumed', 'unit-unknown', 'unit-angstrom', 'non-finite-samples', 'trailing-bytes', 'values-rescaled', 'duplicate-file', 'looks-like-labels', 'frame-of-reference', 'empty-planes', 'distance-assumed', 'overlapping-segments', 'contours-skipped', 'contours-interpolated', 'fractional-segments', 'padding', 'duplicate-slice', 'directions-corrected', 'positions-rounded', 'frames-as-slices', 'header-corrected', 'rescale-ignored', 'labels-rounded', 'labels-renumbered', 'chunks-missing', 'orientation-changed', 'thin-walls', 'volume-changed']
#: A reason to reject a volume, unless the query accepts it.
AcceptableNote = Literal['space-assumed', 'frame-of-reference', 'distance-assumed', 'padding', 'duplicate-slice', 'directions-corrected', 'positions-rounded', 'frames-as-slices']


class Preset(TypedDict):
    name: str
    iso: float


class IgnoredObject(TypedDict):
    #: The name of the file, without folders.
    name: str
    reason: str


class DicomIdentityEquipment(TypedDict):
    """The device that made the images."""

    manufacturer: str
    model_name: str
    station_name: str
    device_serial_number: str
    software_versions: str


class DicomIdentity(TypedDict):
    """The patient and the origin of a volume from DICOM. Only the uploader sees it, and lists
    of volumes leave it out. A text is empty if DICOM does not give it."""

    patient_name: str
    patient_id: str
    patient_birth_date: str
    patient_sex: str
    study_uid: str
    study_date: str
    study_time: str
    study_id: str
    study_description: str
    accession_number: str
    referring_physician: str
    series_uid: str
    series_description: str
    modality: str
    frame_of_reference_uid: str
    #: The objects of the slices, in the order of the slices.
    instances: Sequence[DicomInstance]
    issuer_of_patient_id: str
    patient_identity_removed: str
    deidentification_method: str
    acquisition_datetime: str
    position_reference_indicator: str
    equipment: DicomIdentityEquipment
    #: The coded meanings of the segments. Left out if there are none.
    segments: NotRequired[Sequence[DicomSegment]]


class DicomSegment(TypedDict):
    #: The label of the segment in the volume.
    label: int
    category: DicomCode
    type: DicomCode
    region: DicomCode


class DicomCode(TypedDict):
    """An entry of a coding scheme. Its texts are empty if nothing was coded."""

    value: str
    scheme: str
    meaning: str


class DicomInstance(TypedDict):
    sop_class_uid: str
    sop_instance_uid: str


class Histogram(TypedDict):
    #: The volume's id.
    volume: str
    #: The beginning of the first bin and the end of the last one: the smallest and the largest
    #: sample of the volume.
    range: Sequence[float]
    #: The number of samples in each bin. All bins have the same width. A sample on an edge counts
    #: for the bin above; the largest counts for the last bin.
    counts: Sequence[int]


class VolumeLabels(TypedDict):
    #: The volume's id.
    volume: str
    #: The value of samples without a label.
    background: int
    #: In ascending order.
    labels: Sequence[VolumeLabel]
    #: The cursor of the next page. Null on the last page.
    next: Optional[str]


class VolumeLabel(TypedDict):
    label: int
    voxels: int
    #: The volume of these voxels.
    volume_mm3: float
    #: The smallest index of its voxels along x, y and z.
    low: Sequence[int]
    #: The largest index of its voxels along x, y and z.
    high: Sequence[int]
    #: The smallest and the largest corner of the box around these voxels (LPS, mm).
    bounds: Sequence[Sequence[float]]
    #: The name in the file. Null if there is none.
    name: Optional[str]
    #: The colour in the file. Null if there is none.
    color: Optional[str]


class EstimateQueue(TypedDict):
    """The current number of jobs that the client can see."""

    queued: int
    running: int


class EstimateLabels(TypedDict):
    label: int
    triangles: int


class Estimate(TypedDict):
    #: The volume's id.
    volume: str
    #: Otsu's threshold if it was requested. Left out for a job by labels.
    iso: NotRequired[float]
    scheme: Scheme
    #: The exact number for the extracted surface, before components and fill_cavities remove
    #: anything and before simplification.
    triangles: int
    #: The exact number for the same surface.
    vertices: int
    #: About how many triangles remain if the parameters request fewer.
    simplified_triangles: NotRequired[int]
    #: The size of each file. Exact for stl, unless components, fill_cavities or simplification
    #: (triangles, max_error_mm) remove triangles.
    bytes: Mapping[str, int]
    #: The peak memory of the job without its mapped volume. An upper estimate.
    memory_bytes: int
    #: Whether a job may use that much memory.
    fits: bool
    #: The time of the run, without the queue.
    milliseconds: float
    queue: EstimateQueue
    #: For a job by labels: the exact number of triangles of each label's surface. Left out if
    #: there are more than 256 labels.
    labels: NotRequired[Sequence[EstimateLabels]]
    #: The number of labels if they are not listed.
    labels_count: NotRequired[int]


class Callback(TypedDict):
    """Receives a POST with the job when the job ends, whatever the result. The body is that of
    GET. Only addresses that the operator has listed are called. The request is signed as in
    Standard Webhooks (webhook-id, webhook-timestamp, webhook-signature). It is repeated for a
    day until it succeeds. It may arrive more than once with the same webhook-id."""

    #: An http or https URL without a user, a password or a fragment.
    url: str


Iso = Union["Union[float, Literal['otsu'], Literal['skin'], Literal['soft-tissue'], Literal['bone'], Literal['segment']]"]
Inside = Literal['above', 'below']
Labels = Union["Union[Literal['all'], Sequence[int]]"]
Background = int
LabelNames = Union['Union[Mapping[int, str], Mapping[str, str]]']
LabelColors = Union['Union[Mapping[int, str], Mapping[str, str]]']
LabelValues = Union['Union[Mapping[int, Sequence[int]], Mapping[str, Sequence[int]]]']
Scheme = Literal[5, 6, 'fcc', 'kuhn', 'bcc']
Interpolation = Literal['linear', 'midpoint']
Regularize = bool
Passes = int
Smoothing = Literal['laplacian', 'taubin', 'angle', 'optimize', 'labels']
Lambda = Union['Optional[float]']
PassBand = float
MaxDisplacement = Union['Optional[float]']
Untangle = bool
Close = bool
#: Keep the N largest connected components.
Keep = Union['Optional[int]']
#: Drop connected components with fewer triangles than this.
MinTriangles = Union['Optional[int]']
#: Keep the connected component nearest to each of these points. A point is x, y and z in
#: millimetres (LPS). A query lists the numbers of all points in one row. The nearest component
#: is the one with the nearest vertex.
NearestTo = Union['Sequence[Sequence[float]]']
FillCavities = bool
Crop = Union['Optional[Sequence[Sequence[float]]]']
MaxError = Union['Optional[float]']
Triangles = Union['Optional[int]']
#: Bits per coordinate in drc, and in glb with a codec. The grid spans the mesh's longest side.
PositionBits = int
#: Draco's encoding speed; low values make smaller files and take longer. 0 to 4 use valence
#: coding by libdraco: the smallest files, slow. 5 to 9 are all the same: isomesh's own
#: encoder, which uses several threads and takes no more bytes than libdraco at 5. 10 uses
#: sequential coding by libdraco: the order of vertices and triangles is kept, at several times
#: the bytes.
Speed = int
Normals = bool
Distances = bool
Lods = Union['Sequence[float]']
Merge = bool
GlbCodec = Literal['draco', 'none', 'meshopt', 'khr-meshopt', 'quantized']
Space = Literal['lps', 'ras']
Priority = Literal['stat', 'routine', 'bulk']
Certify = bool
MinThickness = Union['Optional[float]']


class JobParametersComponents(TypedDict):
    """Which connected components to keep; the others are dropped before smoothing. With several
    members, nearest_to chooses first, min_triangles drops some of these, and keep chooses among
    the rest. Components are ranked by their number of triangles, equal ones by their first
    vertex. Without members all are kept. Labels do not allow it."""

    keep: NotRequired[Keep]
    min_triangles: NotRequired[MinTriangles]
    nearest_to: NotRequired[NearestTo]


class JobParametersDraco(TypedDict):
    """Options of the drc format, and of the Draco streams in glb."""

    position_bits: NotRequired[PositionBits]
    speed: NotRequired[Speed]


class _Parameters(TypedDict, total=False):
    iso: Iso
    inside: Inside
    labels: Labels
    background: Background
    label_names: LabelNames
    label_colors: LabelColors
    label_values: LabelValues
    scheme: Scheme
    interpolation: Interpolation
    regularize: Regularize
    passes: Passes
    smoothing: Smoothing
    pass_band: PassBand
    max_displacement_mm: MaxDisplacement
    untangle: Untangle
    close: Close
    components: JobParametersComponents
    fill_cavities: FillCavities
    crop: Crop
    max_error_mm: MaxError
    triangles: Triangles
    formats: Sequence[MeshFormat]
    draco: JobParametersDraco
    normals: Normals
    distances: Distances
    lods: Lods
    merge: Merge
    glb_codec: GlbCodec
    space: Space
    priority: Priority
    certify: Certify
    min_thickness_mm: MinThickness
    callback: Callback


class JobOptions(_Parameters, total=False):
    """The parameters of a job.

    Every member is a keyword of Client.mesh, Client.submit and Client.estimate.

    iso
        The iso-value in the volume's units, otsu for Otsu's threshold, or the name of one of
        the volume's presets. A sample is inside when its value is >= iso; see inside. A CT in
        Hounsfield units has skin, soft-tissue and bone, a fractional segmentation has segment,
        if the value occurs in it. The job then has the preset's number.

    inside
        The samples inside the surface: those of at least the iso-value, or those below it.
        below is for dark structures, such as airways, ventricles and cysts. Samples beyond the
        volume's border are never inside. Padding and NaN have the value of the smallest sample.

    labels
        Labels of a segmentation to mesh instead of an iso-value: their values, or all. Each
        label gets a surface of its own. Neighbouring labels share the wall between them. Values
        that are not listed are background. Vertices lie half-way between two samples. Some
        defaults differ from those of jobs with an iso-value. With another smoothing than labels
        no vertex moves farther than half the smallest spacing.

    background
        The value of samples without a label.

    label_names
        Names of the labels, by value. Labels that are not listed keep the name from the
        volume's file.

    label_colors
        Colours of the labels as #rrggbb, by value. Labels that are not listed keep the colour
        from the volume's file, or get one of a fixed series.

    label_values
        The labels of the volume that each label joins, for labels that join several. A label of
        the volume may be in several lists; these labels then overlap there. In a list, it is no
        longer a label itself, unless it has a list, too. The volume's labels are those of GET
        /v1/volumes/{id}/labels, also if its samples have other numbers.

    scheme
        Number of tetrahedra per cell, or lattice. 6 is Kuhn's split of the primitive cubic
        lattice. 5 is the subdivision of the face-centred cubic lattice: every second cell is
        mirrored; the cell (0,0,0) is not. The names kuhn and fcc mean 6 and 5. bcc is the
        body-centred cubic lattice, which has a sample in the centre of each cell, too, the mean
        of its corners: 1.4 times as many triangles as 6, with larger angles. It is not for
        labels.

    interpolation
        Position of a vertex on the edge between two samples. linear interpolates the two
        samples; midpoint puts every vertex half-way.

    regularize
        Join the vertices around a sample where that keeps the topology. The surface has about a
        third as many triangles, with larger angles. It keeps its connected components, its
        boundary and its genus. Vertices at the volume's border stay where they are. The same
        holds for the own surface of each label. False gives a vertex to each edge between two
        samples that the surface crosses. At an iso-value, max_error_mm does the same: its limit
        is measured from that surface.

    passes
        Number of smoothing passes. Vertices on the surface's boundary stay where they are.
        labels smoothes once, whatever their number, and moves the boundary within the volume's
        border; 0 leaves the surface as it is extracted. For labels the default is 10.

    smoothing
        The smoothing method. laplacian: each pass moves every vertex towards the mean of its
        neighbours by the factor lambda; the enclosed volume shrinks. taubin: each pass does the
        same and then moves all vertices back by the factor mu, where 1/lambda + 1/mu =
        pass_band. A pass is thus two steps: they remove noise and keep shape and volume. angle
        and optimize keep shape and volume and make the angles of triangles larger: each pass
        moves every vertex along the extracted surface. Neither uses lambda, and neither removes
        noise. angle moves it towards the bisectors of its neighbours' angles. optimize moves it
        towards the mean of its neighbours in the first half of the passes, and then to wherever
        the smallest angle becomes larger. labels is for labels alone: it takes the steps of the
        voxels away, keeps flat faces, and gives each label the volume of its voxels, to a few
        tenths of a percent; of a few voxels, to some percent. For labels the default is labels.

    lambda_
        Relaxation factor of a pass; 1 moves a vertex onto the mean of its neighbours. Null: 1
        for laplacian, 0.33 for taubin, which takes at most 0.66. For labels the default is
        0.33.

    pass_band
        For taubin: keep surface frequencies below this, and smooth higher ones. They range from
        0 (constant) to 2 (the sign changes from each vertex to the next).

    max_displacement_mm
        Smoothing moves no vertex farther than this from its extracted position. In millimetres.
        Null means no limit; but labels that are smoothed by laplacian or taubin move half the
        smallest spacing at most.

    untangle
        Remove the self-intersections that smoothing makes: move vertices back towards their
        extracted positions. The vertices of triangles that intersect move back by half, again
        and again, until no triangles intersect; at worst to where they were extracted. It needs
        smoothing, so passes must not be 0. mesh.untangled says what was found and moved.
        certify counts again, also in files that round coordinates.

    close
        Cap the surface where it meets the volume's border. Samples beyond the border then count
        as outside. The result has no boundary. Caps lie in the border, stay flat and are not
        smoothed. The rest is smoothed as if the surface were open.

    components
        Which connected components to keep; the others are dropped before smoothing. With
        several members, nearest_to chooses first, min_triangles drops some of these, and keep
        chooses among the rest. Components are ranked by their number of triangles, equal ones
        by their first vertex. Without members all are kept. Labels do not allow it.

    fill_cavities
        Remove enclosed cavities: their walls and all connected components inside them. A cavity
        is enclosed if no opening leads to it.

    crop
        Mesh only what lies in this box: its smallest and its largest corner in millimetres
        (LPS). Samples outside the box are ignored, as if the volume ended there. If the
        volume's axes are oblique, the box's extents along those axes are used. Caps close the
        surface: close is true.

    max_error_mm
        The distance between each file and the extracted surface, or for labels the smoothed
        surface, is at most this. In millimetres, in both directions. At an iso-value, smoothing
        may use half of it. For labels, max_displacement_mm limits smoothing. Simplification
        then removes as many triangles as the rest allows, and Draco's coordinates get as many
        bits as that takes. The distance is proven for every point; if that cannot be done,
        mesh.certificate says so. See certify, which is switched on.

    triangles
        Simplify the surface to at most this many triangles. If max_error_mm is given too, the
        limit that is reached first applies; the response names it. The resulting error is
        measured: see certify, which is switched on unless it is set to false.

    formats
        The file formats to write.

    draco
        Options of the drc format, and of the Draco streams in glb.

    normals
        Write vertex normals to glb: means of the triangles' normals, weighted by area. Where
        max_error_mm or triangles simplifies a surface at an iso-value, they are the gradient of
        the samples instead, so facets are not seen. Without normals, viewers shade each
        triangle flat or compute their own.

    distances
        Write each vertex's distance to the extracted surface to glb, in millimetres. The vertex
        attribute is _DISTANCE_MM; every level of detail has it. With the codec draco, values
        are rounded to a four thousandth of the largest. The page shows them as colours. The
        formats must include glb.

    lods
        Levels of detail in glb, as decreasing fractions of the triangles; the first is 1. At
        most 8. They use the extension MSFT_lod; readers that do not know it ignore them. The
        formats must include glb.

    merge
        Write the surface to glb as one primitive; with labels, as one per label. For programs
        that take each primitive for a separate object. Otherwise there is one per hundred
        thousand triangles or so; they are written and read in parallel. With the codec none,
        there is always one.

    glb_codec
        How the surface in glb is compressed. draco is KHR_draco_mesh_compression and makes the
        smallest files. none needs no extension: exact floats in one primitive for each surface,
        for every reader of glTF, with about ten times as many bytes. meshopt is
        EXT_meshopt_compression and is read faster than draco; khr-meshopt is the same under the
        newer name KHR_meshopt_compression. quantized is KHR_mesh_quantization: rounded numbers
        that are not compressed. Readers must support the one that is used. isomesh mesh asks
        for none by default.

    space
        Directions of x and y in the files: to the patient's left and back, or to the right and
        front. z points to the head. gii is always RAS. glb has a node of its own that turns Y
        up.

    priority
        Jobs start in order of priority. Within a priority, owners take turns by the time that
        their jobs are expected to take, and each owner's jobs start by age.

    certify
        Measure how far the files are from the extracted surface, and where they intersect
        themselves. If max_error_mm or triangles simplifies labels, the distance counts from the
        smoothed surface instead; mesh.certificate.reference names it.

    min_thickness_mm
        Measure how thick walls are, and the area of those that are thinner than this, such as
        the width of a printer's nozzle. In millimetres. It changes no file: nothing is made
        thicker. mesh.thickness has the result.

    callback
        Receives a POST with the job when the job ends, whatever the result. The body is that of
        GET. Only addresses that the operator has listed are called. The request is signed as in
        Standard Webhooks (webhook-id, webhook-timestamp, webhook-signature). It is repeated for
        a day until it succeeds. It may arrive more than once with the same webhook-id.
    """

    lambda_: Lambda


_Others = TypedDict('_Others', {'volume': 'str', 'lambda': 'Lambda'}, total=False)


class JobParameters(_Parameters, _Others):
    """The parameters of a job as JSON; see JobOptions."""


#: The parameters of a job, with the defaults of those that the request left out. A parameter
#: that is not required here may be absent. It then has its default, or does not apply to the
#: job.
CompleteJobParameters = Union['JobParameters']


class Job(TypedDict):
    """A job and, if it succeeded, its mesh. label_names, label_colors and label_values are
    empty here if they have more than 256 entries."""

    #: A UUID. Newer jobs have greater ids.
    id: str
    state: JobState
    stage: Stage
    #: The progress of the whole job.
    progress: float
    parameters: CompleteJobParameters
    #: The volume's id, as in the parameters.
    volume: str
    priority: Priority
    created: str
    #: Null while the job is queued.
    started: Optional[str]
    #: Null until the job ends.
    finished: Optional[str]
    timing: Timing
    #: Null unless the job has succeeded.
    mesh: Optional[MeshSummary]
    #: Null unless the job has failed.
    error: Optional[Problem]
    #: Whether the job used the mesh of an earlier job with the same volume and parameters.
    #: Priority and callback may differ.
    reused: bool
    #: What a queued job waits for, other than a worker. disk means that it runs when there is
    #: space for its files. Otherwise null.
    waiting_for: Optional[Literal['disk']]


class JobReport(TypedDict):
    """Everything that a person needs to judge a mesh later. The job has the parameters, times,
    sizes, components, the bound and how it was proven, and the SHA-256 of each file. The volume
    has the patient, the geometry and the SHA-256 of the samples."""

    #: The version of the service that reports.
    version: str
    #: The version of its code that makes meshes.
    mesher: str
    job: Job
    #: Without the identifiers of single slices. Null if the volume was deleted.
    volume: Optional[Volume]


#: The current stage of a job, or its last one.
Stage = Literal['queue', 'load', 'extract', 'smooth', 'untangle', 'simplify', 'encode', 'certify', 'thickness', 'done']


class Timing(TypedDict):
    """The milliseconds of each stage. 0 for a stage that has not ended."""

    #: From acceptance to start.
    queue: float
    #: Loading the samples into memory.
    load: float
    #: Marching tetrahedra.
    extract: float
    #: All smoothing passes.
    smooth: float
    #: Removing self-intersections, if requested.
    untangle: float
    #: Simplification, if fewer triangles are requested.
    simplify: float
    #: Writing the files and measuring the mesh.
    encode: float
    #: Measuring the error, if requested.
    certify: float
    #: Measuring the thickness of walls, if requested.
    thickness: float
    #: From acceptance to end.
    total: float


class MeshSummaryDropped(TypedDict):
    """What components and fill_cavities removed."""

    components: int
    triangles: int


class MeshSummaryUntangled(TypedDict):
    """Only for a job with untangle."""

    #: Pairs of triangles that intersected after smoothing.
    pairs: int
    #: Vertices that moved back towards their extracted positions.
    vertices: int
    #: Pairs that still intersect. Their vertices stand where they were extracted, so the extracted
    #: surface has these intersections, too.
    left: int


class MeshSummarySimplified(TypedDict):
    """Only for a job with max_error_mm or triangles."""

    triangles_before: int
    #: What stopped the simplification: the error, the number of triangles, or, if there are more
    #: than triangles, the topology. Fewer would open or fold the surface, or change its boundary,
    #: junction curves or handles: a closed connected component has at least 4 triangles.
    bound_by: Literal['error', 'triangles', 'topology']


class MeshSummaryVolumeMm3(TypedDict):
    """The volume that the surface encloses, before and after smoothing and simplification. An
    open surface encloses nothing. It is then closed by a cone to the first sample, so the
    number depends on that point and may be negative. A surface that is inside out encloses
    nothing either, and its number is negative. See quality.encloses_volume and the parameters
    close and inside."""

    extracted: float
    smoothed: float


class MeshSummaryDisplacementMm(TypedDict):
    """How far smoothing moved the vertices from their extracted positions, after untangle."""

    mean: float
    max: float


class MeshSummary(TypedDict):
    """The numbers of the mesh, after smoothing unless stated otherwise. For a job by labels:
    triangles, vertices and areas count each wall between labels once. Volumes are what all
    labels enclose together. Connected components, edges and quality cover the surfaces of all
    labels."""

    #: The iso-value that was used, also for Otsu's. Left out for a job by labels.
    iso: NotRequired[float]
    #: There is no surface; see empty_reason. The job succeeds all the same, and its files have no
    #: triangles.
    empty: bool
    #: The reason, with the range of the volume's samples and its suggested iso-value if they help.
    #: Only for an empty surface. A job of an older server does not have it.
    empty_reason: NotRequired[str]
    triangles: int
    vertices: int
    #: Edges that belong to one triangle only. They lie on the volume's border. A surface made with
    #: close has none.
    boundary_edges: int
    #: The number of connected components.
    components: int
    #: Vertices - edges + triangles.
    euler: int
    dropped: MeshSummaryDropped
    untangled: NotRequired[MeshSummaryUntangled]
    simplified: NotRequired[MeshSummarySimplified]
    quality: MeshQuality
    area_mm2: float
    #: Before smoothing.
    area_extracted_mm2: float
    volume_mm3: MeshSummaryVolumeMm3
    displacement_mm: MeshSummaryDisplacementMm
    #: The smallest and the largest corner. Zero for an empty mesh.
    bounds: Sequence[Vector]
    #: One entry for each requested format. For a job by labels: the formats that hold all labels,
    #: and a zip of the others.
    files: Mapping[str, MeshFile]
    #: For a job by labels, in ascending order. Lists of jobs leave it out. A job with more than
    #: 256 labels has labels_count instead.
    labels: NotRequired[Sequence[LabelSummary]]
    #: The number of labels, only if there are more than 256. /v1/jobs/{id}/labels lists them.
    labels_count: NotRequired[int]
    #: For a job by labels: how many pairs of labels touch, or of a label and the background.
    #: /v1/jobs/{id}/walls lists them. A job of an older server does not have it.
    walls_count: NotRequired[int]
    #: For a job by labels: how many pairs the same list has besides with edge_contacts=true. A job
    #: of an older server does not have it, and its walls_count includes them.
    edge_contacts_count: NotRequired[int]
    certificate: NotRequired[MeshCertificate]
    thickness: NotRequired[Thickness]
    #: Notes on the mesh alone. Left out if there are none. Those on its volume are the volume's.
    notes: NotRequired[Sequence[Note]]


class Thickness(TypedDict):
    """How thick the walls are. Only for a job with min_thickness_mm. The thickness at a point
    of the surface is the way from it through the material, against the normal of its triangle,
    to the opposite side: the first triangle there, if it faces away within about 60 degrees. An
    edge is no wall: nearer than min_thickness_mm to where both sides meet, there is no
    thickness. The gap between two bodies is no wall. It is measured at the centres of all
    triangles, and of the parts into which large ones are divided, in the mesh before files
    round its coordinates. Of labels, in each label's own surface."""

    #: The least thickness. null if no point has an opposite side, for example in an open sheet. A
    #: rough surface has walls of nearly nothing somewhere, and so have specks beside it:
    #: thin_area_mm2 tells more about a print.
    thinnest_mm: Optional[float]
    #: A point of the surface with that thickness, in LPS millimetres.
    place: Optional[Vector]
    #: The area of the surface where its wall is thinner than min_thickness_mm. A thin wall has two
    #: sides.
    thin_area_mm2: float


class MeshCertificateBudgetMm(TypedDict):
    """How max_error_mm was divided among three causes."""

    #: The largest movement of a vertex by smoothing. 0 if the reference is the smoothed surface.
    smoothing: float
    #: The remaining error.
    simplification: float
    #: The largest movement of a point by rounding the coordinates in a file.
    quantisation: float


class MeshCertificate(TypedDict):
    """The distance between the files and the surface that reference names. Only for a job with
    certify. The bytes of drc and glb, which round coordinates, are decoded by an independent
    reader. All other formats hold the mesh exactly, so the mesh is measured once for all of
    them. The distance is measured at all vertices and at the centres of all triangles. It is
    the exact distance from each point to the triangles of the other surface. Distances are
    stored in single precision."""

    #: The surface that the distances count from. extracted: before smoothing. smoothed: after
    #: smoothing and untangling, before simplification, for a job that simplifies labels. Then
    #: displacement_mm has how far smoothing moved the vertices, so bound_mm and its max together
    #: bound the distance from the extracted surface.
    reference: Literal['extracted', 'smoothed']
    #: The file with the largest distance. The distances are those of this file. Of several files
    #: that hold the mesh exactly, the first.
    file: MeshFormat
    #: Whether bound_mm was proven for every point. If not, why_unproven says why, and other points
    #: can be farther than found_mm.
    proven: bool
    #: No point of any file is farther from the reference surface, and no point of the reference
    #: surface is farther from any file. At most max_error_mm. Only if it was proven.
    bound_mm: NotRequired[float]
    #: Why the distance was measured and not proven.
    why_unproven: NotRequired[str]
    #: The largest distance that was found, in both directions.
    found_mm: float
    #: From the file to the reference surface. Shows what was added.
    from_mesh: DistanceSummary
    #: From the reference surface to the file. Shows what was removed.
    from_extracted: DistanceSummary
    budget_mm: NotRequired[MeshCertificateBudgetMm]


class DistanceSummary(TypedDict):
    points: int
    max_mm: float
    mean_mm: float
    rms_mm: float
    #: 99 % of the points are at most this far.
    p99_mm: float
    #: The number of points in equal bins from 0 to max_mm.
    histogram: Sequence[int]


class WallSummary(TypedDict):
    """The area where two labels touch, or where a label is next to the background, after
    smoothing. What closes a label at the volume's border with close is next to the background,
    too. The areas of a label's walls add up to the area of its surface, and those of all walls
    to the area of the mesh, if edge_contacts are among them. Only where labels overlap they may
    be more: a triangle counts for each pair of a label that ends there on one side and a label
    that ends there on the other side."""

    a: int
    #: The other label, the greater number. Null for the background.
    b: Optional[int]
    area_mm2: float
    #: How many faces the voxels of the two share, in the samples of the job: what smoothing and
    #: simplification do does not change it. 0 if they meet at edges and corners only. A job of an
    #: older server does not have it.
    faces: NotRequired[int]
    a_name: Optional[str]
    #: Null also for the background.
    b_name: Optional[str]


class LabelSummary(TypedDict):
    """The samples and the smoothed surface of one label. A wall between two labels is part of
    both."""

    label: int
    name: Optional[str]
    color: Optional[str]
    voxels: int
    #: The volume of these voxels.
    voxels_mm3: float
    triangles: int
    vertices: int
    closed: bool
    manifold: bool
    oriented: bool
    components: int
    area_mm2: float
    #: The volume that the surface encloses, if it is closed and oriented. Otherwise the number
    #: depends on the point of reference and may be negative: the label touches the border of the
    #: volume. See the parameter close. A closed label has a negative number if its surface is only
    #: around a cavity, which encloses nothing.
    volume_mm3: float
    #: The label's files in the ZIP, one for each format.
    files: Mapping[str, LabelFile]


class LabelFile(TypedDict):
    bytes: int
    sha256: str
    #: The offset of its first byte in the ZIP.
    offset: int
    #: The address to download it from.
    href: str


class MeshQualitySelfIntersections(TypedDict):
    """Pairs of triangles that intersect at more than their shared corners and edges, computed
    exactly: in the decoded file that has the most, with its vertices at the same place as one.
    For labels they are counted in the walls, before files round their coordinates. Only for a
    job with certify."""

    pairs: int
    #: Triangles that intersect another one.
    triangles: int
    #: The places of the first pairs, in LPS millimetres.
    places: Sequence[Vector]


class MeshQuality(TypedDict):
    """The quality of the mesh. Each job measures all values on the mesh itself."""

    #: No edge belongs to one triangle only.
    closed: bool
    #: At most two triangles share an edge, and the triangles around each vertex are one fan, open
    #: or closed.
    manifold: bool
    #: Triangles that share an edge use it in opposite directions.
    oriented: bool
    #: The number of connected components.
    components: int
    #: The sum of the handles of all connected components. Null if the mesh is open or not a
    #: manifold.
    genus: Optional[int]
    #: For each triangle: twice the radius of the inscribed circle divided by the radius of the
    #: circumscribed circle. 1 is equilateral, 0 is flat. The bins are 0.05 wide.
    aspect_ratio: QualityStages
    #: The smallest angle of each triangle, at most 60 degrees. The bins are 3 degrees wide.
    smallest_angle_deg: QualityStages
    #: Whether the volumes are those that the surface encloses: it is closed and oriented, and not
    #: inside out. The volumes of an open surface depend on the point of reference. Those of a
    #: surface around a dark structure are negative, unless the job has inside: below.
    encloses_volume: bool
    self_intersections: NotRequired[MeshQualitySelfIntersections]


class QualityStages(TypedDict):
    """Before and after smoothing."""

    extracted: Distribution
    smoothed: Distribution


class Distribution(TypedDict):
    """Over all triangles. If there are more than 1 048 576, over about half a million that are
    spread over the mesh; the sum of the histogram is their number. 0 if there are none."""

    mean: float
    min: float
    #: The number of measured triangles in equal bins from 0. The last bin includes its end.
    histogram: Sequence[int]


class MeshFile(TypedDict):
    bytes: int
    sha256: str
    #: The address to download it from.
    href: str


class ProblemErrors(TypedDict):
    field: str
    message: str


class ProblemChoicesSeries(TypedDict):
    """What tells DICOM series apart, in DICOM's forms. Empty where the files do not say."""

    patient_name: str
    patient_id: str
    study_uid: str
    study_description: str
    study_date: str


class ProblemChoicesPicture(TypedDict):
    """A slice in the middle, of at most 96 x 96 pixels. DICOM series have one, except those
    after the first 100, and so have the volumes of a file, such as time points, whose samples
    lie one after another without a compression of their own; all of these are drawn by the
    window of the first, and smaller if there are many."""

    width: int
    height: int
    #: A byte for each pixel, row by row, in base64.
    grey: str


class ProblemChoices(TypedDict):
    #: The query parameter to add.
    parameter: Literal['series', 'member', 'volume', 'spacing']
    value: str
    #: A description of the value, for people.
    title: str
    series: NotRequired[ProblemChoicesSeries]
    picture: NotRequired[ProblemChoicesPicture]


class Problem(TypedDict):
    """Describes what went wrong (RFC 9457)."""

    #: A stable name, for programs.
    type: Literal['urn:isomesh:problem:invalid-parameter', 'urn:isomesh:problem:digest-mismatch', 'urn:isomesh:problem:unauthorized', 'urn:isomesh:problem:forbidden', 'urn:isomesh:problem:not-found', 'urn:isomesh:problem:method-not-allowed', 'urn:isomesh:problem:not-ready', 'urn:isomesh:problem:gone', 'urn:isomesh:problem:length-required', 'urn:isomesh:problem:too-large', 'urn:isomesh:problem:uri-too-long', 'urn:isomesh:problem:unsupported-media', 'urn:isomesh:problem:range-not-satisfiable', 'urn:isomesh:problem:unusable-volume', 'urn:isomesh:problem:empty-surface', 'urn:isomesh:problem:key-reused', 'urn:isomesh:problem:too-many-requests', 'urn:isomesh:problem:internal', 'urn:isomesh:problem:unavailable', 'urn:isomesh:problem:out-of-space', 'urn:isomesh:problem:cancelled', 'urn:isomesh:problem:request-timeout', 'urn:isomesh:problem:precondition-failed', 'urn:isomesh:problem:headers-too-large', 'urn:isomesh:problem:pacs-unreachable', 'urn:isomesh:problem:pacs-refused', 'urn:isomesh:problem:series-incomplete', 'https://iana.org/assignments/http-problem-types#mismatching-upload-offset']
    #: The type in words.
    title: str
    #: The HTTP status.
    status: int
    #: What is wrong with this request, for people.
    detail: str
    #: The path of the request or of the job.
    instance: NotRequired[str]
    #: The parameters or members that are wrong.
    errors: NotRequired[Sequence[ProblemErrors]]
    #: If a user may override the rejection: the code to add to the query accept to have the same
    #: request accepted.
    overridable: NotRequired[AcceptableNote]
    #: The possible choices if the request is ambiguous, at most 1000.
    choices: NotRequired[Sequence[ProblemChoices]]


class SucceededJob(TypedDict):
    """A job that has succeeded: its mesh is never None. Job describes the members."""

    id: str
    state: Literal['succeeded']
    stage: Stage
    progress: float
    parameters: CompleteJobParameters
    volume: str
    priority: Priority
    created: str
    started: str
    finished: str
    timing: Timing
    mesh: MeshSummary
    error: Optional[Problem]
    reused: bool
    waiting_for: Optional[Literal['disk']]
