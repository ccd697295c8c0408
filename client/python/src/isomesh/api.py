"""The types of the server's requests and responses. `generate` makes this file from openapi.yaml.

The types describe JSON objects and are for type checkers: at run time every response is a plain dict.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Mapping, Optional, Sequence, TypedDict, Union

if TYPE_CHECKING:
    from typing_extensions import NotRequired


SampleType = Literal['uint8', 'int8', 'uint16', 'int16', 'uint32', 'int32', 'float32', 'float64']


MeshFormat = Literal['drc', 'glb', 'stl', 'ply', 'obj', '3mf', 'off', 'vtk', 'vtp', 'gii', 'zip']


MeshBytes = str


JobState = Literal['queued', 'running', 'succeeded', 'failed', 'cancelled']


Stage = Literal['queue', 'load', 'extract', 'smooth', 'simplify', 'encode', 'certify', 'done']


Vector = Union['Sequence[float]']


class Volume(TypedDict):
    """A volume that is stored. The sample (i,j,k) lies at origin + direction * diag(spacing) *
    (i,j,k), in millimetres, in DICOM's patient space (LPS)."""

    #: The SHA-256 of what identifies the volume, its samples and geometry.
    id: str
    #: What its owner calls it: the series or file that it came as, until it is renamed. No part of
    #: the id, in no mesh and in no log. Null where nothing told one.
    name: Optional[str]
    #: What was uploaded first.
    format: Literal['raw', 'nifti', 'nrrd', 'metaimage', 'vti', 'dicom']
    #: Samples along x, y and z.
    dims: Sequence[int]
    #: The type of one sample.
    type: SampleType
    #: Millimetres between samples along each axis; along z from slice to slice, also where slices
    #: are sheared by a tilted gantry.
    spacing: Vector
    #: Where the first sample lies.
    origin: Vector
    #: Row-major; the columns are the unit vectors of x, y and z. They are at right angles but for
    #: a tilted gantry, which shears z.
    direction: Sequence[float]
    #: The smallest and the largest sample.
    range: Sequence[float]
    #: Otsu's threshold.
    suggested_iso: float
    #: Of all samples.
    bytes: int
    created: str
    #: DICOM's name for what made the images, such as CT or MR; null when it is not told.
    modality: Optional[str]
    #: Iso-values that suit the modality, as far as they lie within range: for a CT in Hounsfield
    #: units skin, soft tissue and bone.
    presets: Sequence[Preset]
    #: What the upload holds beside the volume, up to a hundred of them.
    ignored: Sequence[IgnoredObject]
    #: What was decided, corrected or left open when the upload was read. The same samples and
    #: geometry are one volume, whatever they came as: as name, format and ignored, its notes are
    #: those of the upload that came first. A GLB repeats those that tell how samples or geometry
    #: came about in asset.extras.notes; a job takes no mesh of an earlier one with other notes.
    notes: Sequence[Note]
    #: Whose volume it is and what it was made from, of a volume that came as DICOM; only for who
    #: uploaded it, and not in lists of volumes. A text that DICOM does not tell is empty.
    dicom: NotRequired[DicomIdentity]


class UploadedVolumesVolumes(TypedDict):
    #: Of the archive, as the query member takes it.
    member: str
    #: As if it had come alone: 201, 200 or that of the problem.
    status: int
    #: Null where it was refused.
    volume: Optional[Volume]
    #: Why it was refused.
    problem: Optional[Problem]


class UploadedVolumes(TypedDict):
    volumes: Sequence[UploadedVolumesVolumes]


class Note(TypedDict):
    #: A name that stays, for programs.
    code: NoteCode
    #: What of it is true of this volume, for people.
    detail: str


NoteCode = Literal['forms-differ', 'pixdim-differs', 'volume-chosen', 'space-assumed', 'unit-unknown', 'non-finite-samples', 'trailing-bytes', 'values-rescaled', 'duplicate-file', 'looks-like-labels', 'frame-of-reference', 'empty-planes', 'distance-assumed', 'overlapping-segments', 'fractional-segments']


AcceptableNote = Literal['frame-of-reference']


class Preset(TypedDict):
    name: str
    iso: float


class IgnoredObject(TypedDict):
    #: Of the file, without folders.
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
    """Whose volume it is and what it was made from, of a volume that came as DICOM; only for
    who uploaded it, and not in lists of volumes. A text that DICOM does not tell is empty."""

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
    #: The objects that hold the slices, in the slices' order.
    instances: Sequence[DicomInstance]
    issuer_of_patient_id: str
    patient_identity_removed: str
    deidentification_method: str
    acquisition_datetime: str
    position_reference_indicator: str
    #: The device that made the images.
    equipment: DicomIdentityEquipment
    #: What the segments of a segmentation are, by their codes; left out where there are none.
    segments: NotRequired[Sequence[DicomSegment]]


class DicomSegment(TypedDict):
    #: The volume's label that the segment became.
    label: int
    #: An entry of a coding scheme; its texts are empty where nothing was coded.
    category: DicomCode
    #: An entry of a coding scheme; its texts are empty where nothing was coded.
    type: DicomCode
    #: An entry of a coding scheme; its texts are empty where nothing was coded.
    region: DicomCode


class DicomCode(TypedDict):
    """An entry of a coding scheme; its texts are empty where nothing was coded."""

    value: str
    scheme: str
    meaning: str


class DicomInstance(TypedDict):
    sop_class_uid: str
    sop_instance_uid: str


class Version(TypedDict):
    version: str
    #: Whether it knows a PACS, so that it takes orders.
    orders: bool
    #: Of what makes meshes. While it stays, the same volume and parameters give the same bytes.
    mesher: str


class VolumeList(TypedDict):
    volumes: Sequence[Volume]
    #: The cursor of the next page; null on the last.
    next: Optional[str]


class Histogram(TypedDict):
    #: The volume's id.
    volume: str
    #: Where the first bin begins and the last one ends, the volume's smallest and largest sample.
    range: Sequence[float]
    #: The samples in each bin, all of equal width. A sample at an edge counts for the bin above,
    #: the largest for the last.
    counts: Sequence[int]


class VolumeLabels(TypedDict):
    #: The volume's id.
    volume: str
    #: The value of samples that belong to no label.
    background: int
    #: In ascending order.
    labels: Sequence[VolumeLabel]


class VolumeLabel(TypedDict):
    label: int
    voxels: int
    #: Of so many voxels.
    volume_mm3: float
    #: The smallest index along x, y and z of its voxels.
    low: Sequence[int]
    #: The largest.
    high: Sequence[int]
    #: The smallest and the largest corner (LPS, mm) of the box of these voxels.
    bounds: Sequence[Sequence[float]]
    #: As the file calls it; null where it does not.
    name: Optional[str]
    #: As the file has it; null where it has none.
    color: Optional[str]


class EstimateQueue(TypedDict):
    """How many jobs there are at the moment, of those that the asker sees."""

    queued: int
    running: int


class EstimateLabels(TypedDict):
    label: int
    triangles: int


class Estimate(TypedDict):
    #: The volume's id.
    volume: str
    #: Otsu's threshold where that was asked for; none by labels.
    iso: NotRequired[float]
    #: Number of tetrahedra per cell. With 5, every second cell is mirrored; the cell (0,0,0) is
    #: not.
    scheme: Scheme
    #: Exact, of the surface as it is extracted: before the parameters components and fill_cavities
    #: drop any, and before it is simplified.
    triangles: int
    #: As exact.
    vertices: int
    #: About how many are left, where the parameters ask for fewer.
    simplified_triangles: NotRequired[int]
    #: Of each file; exact for stl.
    bytes: Mapping[str, int]
    #: At the job's peak, beside its mapped volume; an upper estimate.
    memory_bytes: int
    #: Whether one job may take that much memory.
    fits: bool
    #: Of the run, without the queue.
    milliseconds: float
    #: How many jobs there are at the moment, of those that the asker sees.
    queue: EstimateQueue
    #: Of a job by labels, how many triangles each label's own surface has; exact.
    labels: NotRequired[Sequence[EstimateLabels]]


class Callback(TypedDict):
    """Whom to tell that the job has ended, whichever way: a POST of the job, as GET gives it.
    Only addresses that the operator has listed are called. It is signed as the Standard
    Webhooks specification says (webhook-id, webhook-timestamp, webhook-signature), repeated
    until it is answered with success, for a day, and may come more than once with the same
    webhook-id."""

    #: http or https, without a user, a password or a fragment.
    url: str


Iso = Union["Union[float, Literal['otsu']]"]


Labels = Union["Union[Literal['all'], Sequence[int]]"]


Background = int


LabelNames = Union['Union[Mapping[int, str], Mapping[str, str]]']


LabelColors = Union['Union[Mapping[int, str], Mapping[str, str]]']


LabelValues = Union['Union[Mapping[int, Sequence[int]], Mapping[str, Sequence[int]]]']


Scheme = Literal[5, 6]


Interpolation = Literal['linear', 'midpoint']


Passes = int


Smoothing = Literal['laplacian', 'taubin']


Lambda = Union['Optional[float]']


PassBand = float


MaxDisplacement = Union['Optional[float]']


Close = bool


Keep = Union['Optional[int]']


MinTriangles = Union['Optional[int]']


NearestTo = Union['Sequence[Sequence[float]]']


FillCavities = bool


Crop = Union['Optional[Sequence[Sequence[float]]]']


MaxError = Union['Optional[float]']


Triangles = Union['Optional[int]']


PositionBits = int


Speed = int


Normals = bool


Distances = bool


Lods = Union['Sequence[float]']


Merge = bool


GlbCodec = Literal['draco', 'meshopt']


Space = Literal['lps', 'ras']


Priority = Literal['stat', 'routine', 'bulk']


Certify = bool


class JobParametersComponents(TypedDict):
    """Which connected components to keep; the others are dropped before smoothing. A component
    must meet all members that are given: keep chooses among those that are large enough.
    Components are ranked by their number of triangles, equal ones by their first vertex.
    Without members all are kept. Labels do not allow it."""

    #: Keep the N largest connected components.
    keep: NotRequired[Keep]
    #: Drop connected components with fewer triangles than this.
    min_triangles: NotRequired[MinTriangles]
    #: Keep the connected component nearest to each of these points. A point is x, y and z in
    #: millimetres (LPS). A query lists the numbers of all points in one row. The nearest component
    #: is the one with the nearest vertex.
    nearest_to: NotRequired[NearestTo]


class JobParametersDraco(TypedDict):
    """Options of the drc format, and of the Draco streams in glb."""

    #: Number of bits that Draco keeps per coordinate. The grid spans the mesh's longest side.
    position_bits: NotRequired[PositionBits]
    #: Draco's encoding speed; low values make smaller files and take longer. 0 to 4 use valence
    #: coding by libdraco: the smallest files, slow. 5 to 9 are all the same: isomesh's own
    #: encoder, which uses several threads and takes no more bytes than libdraco at 5. 10 uses
    #: sequential coding by libdraco: the order of vertices and triangles is kept, at several times
    #: the bytes.
    speed: NotRequired[Speed]


JobParameters = TypedDict(
    'JobParameters',
    {
        'volume': 'NotRequired[str]',
        'iso': 'NotRequired[Iso]',
        'labels': 'NotRequired[Labels]',
        'background': 'NotRequired[Background]',
        'label_names': 'NotRequired[LabelNames]',
        'label_colors': 'NotRequired[LabelColors]',
        'label_values': 'NotRequired[LabelValues]',
        'scheme': 'NotRequired[Scheme]',
        'interpolation': 'NotRequired[Interpolation]',
        'passes': 'NotRequired[Passes]',
        'smoothing': 'NotRequired[Smoothing]',
        'lambda': 'NotRequired[Lambda]',
        'pass_band': 'NotRequired[PassBand]',
        'max_displacement_mm': 'NotRequired[MaxDisplacement]',
        'close': 'NotRequired[Close]',
        'components': 'NotRequired[JobParametersComponents]',
        'fill_cavities': 'NotRequired[FillCavities]',
        'crop': 'NotRequired[Crop]',
        'max_error_mm': 'NotRequired[MaxError]',
        'triangles': 'NotRequired[Triangles]',
        'formats': 'NotRequired[Sequence[MeshFormat]]',
        'draco': 'NotRequired[JobParametersDraco]',
        'normals': 'NotRequired[Normals]',
        'distances': 'NotRequired[Distances]',
        'lods': 'NotRequired[Lods]',
        'merge': 'NotRequired[Merge]',
        'glb_codec': 'NotRequired[GlbCodec]',
        'space': 'NotRequired[Space]',
        'priority': 'NotRequired[Priority]',
        'certify': 'NotRequired[Certify]',
        'callback': 'NotRequired[Callback]',
    },
)


CompleteJobParameters = Union['JobParameters']


class Job(TypedDict):
    """A job and, once it has succeeded, its mesh."""

    #: A UUID; younger jobs have greater ones.
    id: str
    state: JobState
    #: What a job does at the moment, or did last.
    stage: Stage
    #: Of the whole job.
    progress: float
    #: All of them, with the defaults of those that were left out.
    parameters: CompleteJobParameters
    #: The volume's id, as in the parameters.
    volume: str
    #: Jobs start in order of priority, then of age.
    priority: Priority
    created: str
    #: Null while the job is queued.
    started: Optional[str]
    #: Null until the job ends.
    finished: Optional[str]
    #: Milliseconds of each stage; 0 for one that has not ended yet.
    timing: Timing
    #: Null unless the job has succeeded.
    mesh: Optional[MeshSummary]
    #: Null unless the job has failed.
    error: Optional[Problem]
    #: Whether the job took the mesh of an earlier job with the same volume and parameters instead
    #: of making it again; priority and callback may differ.
    reused: bool
    #: What a queued job waits for besides a worker: disk is room for its files, and it is run when
    #: there is some. Null otherwise.
    waiting_for: Optional[Literal['disk']]


class JobEvent(TypedDict):
    """How far a job is."""

    state: JobState
    #: What a job does at the moment, or did last.
    stage: Stage
    progress: float


class AnyJobEvent(TypedDict):
    """How far one of all jobs is."""

    #: The job's.
    id: str
    state: JobState
    #: What a job does at the moment, or did last.
    stage: Stage
    progress: float


class JobList(TypedDict):
    jobs: Sequence[Job]
    #: The cursor of the next page; null on the last.
    next: Optional[str]


class Timing(TypedDict):
    """Milliseconds of each stage; 0 for one that has not ended yet."""

    #: From acceptance to the start.
    queue: float
    #: Bringing the samples into memory.
    load: float
    #: Marching tetrahedra.
    extract: float
    #: All passes.
    smooth: float
    #: Where fewer triangles are asked for.
    simplify: float
    #: Writing the files and measuring the mesh.
    encode: float
    #: Where the error is to be measured.
    certify: float
    #: From acceptance to the end.
    total: float


class MeshSummaryDropped(TypedDict):
    """What the parameters components and fill_cavities took away."""

    components: int
    triangles: int


class MeshSummarySimplified(TypedDict):
    """Of a job with max_error_mm or triangles."""

    triangles_before: int
    #: What kept it from going on, the error or the number of triangles.
    bound_by: Literal['error', 'triangles']


class MeshSummaryVolumeMm3(TypedDict):
    """What the surface encloses, before and after smoothing and simplification. An open surface
    encloses nothing: it is closed by the cone to where the first sample lies, and the number
    depends on that point and may be negative; see quality.encloses_volume, and the parameter
    close."""

    extracted: float
    smoothed: float


class MeshSummaryDisplacementMm(TypedDict):
    """How far smoothing moved the vertices from where they were extracted."""

    mean: float
    max: float


class MeshSummary(TypedDict):
    """The mesh in numbers, after smoothing unless named otherwise. By labels: triangles,
    vertices and areas are those of the walls, each counted once; volumes are what all labels
    enclose together; pieces, edges and quality are those of the labels' own surfaces, all of
    them."""

    #: The value that was used; Otsu's, too. None by labels.
    iso: NotRequired[float]
    #: There is no surface: the iso-value is outside the samples' range, or nothing was left of the
    #: parts. The files hold no triangle.
    empty: bool
    triangles: int
    vertices: int
    #: Edges of one triangle only; they lie on the volume's border. A surface that was closed has
    #: none.
    boundary_edges: int
    #: Pieces that do not touch.
    components: int
    #: Vertices - edges + triangles.
    euler: int
    #: What the parameters components and fill_cavities took away.
    dropped: MeshSummaryDropped
    #: Of a job with max_error_mm or triangles.
    simplified: NotRequired[MeshSummarySimplified]
    #: How good the mesh is. All of it is found out on the mesh itself, in each job.
    quality: MeshQuality
    area_mm2: float
    #: Before smoothing.
    area_extracted_mm2: float
    #: What the surface encloses, before and after smoothing and simplification. An open surface
    #: encloses nothing: it is closed by the cone to where the first sample lies, and the number
    #: depends on that point and may be negative; see quality.encloses_volume, and the parameter
    #: close.
    volume_mm3: MeshSummaryVolumeMm3
    #: How far smoothing moved the vertices from where they were extracted.
    displacement_mm: MeshSummaryDisplacementMm
    #: The smallest and the largest corner; zero for an empty mesh.
    bounds: Sequence[Vector]
    #: One for each format that was asked for. By labels those that hold all labels, and a zip of
    #: the others.
    files: Mapping[str, MeshFile]
    #: Of a job by labels, in ascending order. Lists of jobs leave it out.
    labels: NotRequired[Sequence[LabelSummary]]
    #: How far the files are from the surface as it was extracted, before it was smoothed; of a job
    #: with certify. Each file's bytes are decoded as a stranger does, and measured at all vertices
    #: and the centres of all triangles: exact distances from these points to the other surface's
    #: triangles, which are found by a grid. Distances are kept in single precision.
    certificate: NotRequired[MeshCertificate]


class MeshCertificateBudgetMm(TypedDict):
    """How max_error_mm was shared out; the three make it up."""

    #: The farthest that it moved a vertex.
    smoothing: float
    #: The rest.
    simplification: float
    #: The most that rounding the files' coordinates moves a point.
    quantisation: float


class MeshCertificate(TypedDict):
    """How far the files are from the surface as it was extracted, before it was smoothed; of a
    job with certify. Each file's bytes are decoded as a stranger does, and measured at all
    vertices and the centres of all triangles: exact distances from these points to the other
    surface's triangles, which are found by a grid. Distances are kept in single precision."""

    #: Of several files the one that is farthest, which these are the distances of.
    file: MeshFormat
    #: The largest distance, both ways.
    max_mm: float
    #: From the file to the extracted surface; shows what has been added.
    from_mesh: DistanceSummary
    #: From the extracted surface to the file; shows what has been left out.
    from_extracted: DistanceSummary
    #: How max_error_mm was shared out; the three make it up.
    budget_mm: NotRequired[MeshCertificateBudgetMm]


class DistanceSummary(TypedDict):
    points: int
    max_mm: float
    mean_mm: float
    rms_mm: float
    #: 99 of 100 points are this near.
    p99_mm: float
    #: Points in equal bins from 0 to max_mm.
    histogram: Sequence[int]


class LabelSummary(TypedDict):
    """A label's samples and its own surface after smoothing. What two labels share is in
    both."""

    label: int
    name: Optional[str]
    color: Optional[str]
    voxels: int
    #: The volume of so many voxels.
    voxels_mm3: float
    triangles: int
    vertices: int
    closed: bool
    manifold: bool
    oriented: bool
    components: int
    area_mm2: float
    #: What the surface encloses.
    volume_mm3: float
    #: Those in the ZIP, one for each format.
    files: Mapping[str, LabelFile]


class LabelFile(TypedDict):
    bytes: int
    sha256: str
    #: Of its first byte in the ZIP.
    offset: int
    #: Where it is downloaded from.
    href: str


class MeshQualitySelfIntersections(TypedDict):
    """Pairs of triangles that intersect beyond the corners and edges that they share, decided
    exactly. Of a job with certify."""

    pairs: int
    #: That intersect any other.
    triangles: int
    #: Of the first pairs, in millimetres, LPS.
    places: Sequence[Vector]


class MeshQuality(TypedDict):
    """How good the mesh is. All of it is found out on the mesh itself, in each job."""

    #: No edge belongs to one triangle only.
    closed: bool
    #: At most two triangles share an edge, and the triangles around a vertex are one fan, open or
    #: closed.
    manifold: bool
    #: Triangles that share an edge run through it in opposite directions.
    oriented: bool
    #: Pieces that do not touch.
    components: int
    #: The handles of all pieces together; null for a mesh that is open or no manifold.
    genus: Optional[int]
    #: Of each triangle twice the radius of its inscribed circle over that of its circumscribed
    #: one: 1 is equilateral, 0 is flat. Bins of 0.05.
    aspect_ratio: QualityStages
    #: The smallest angle of each triangle, at most 60 degrees. Bins of 3 degrees.
    smallest_angle_deg: QualityStages
    #: Whether the volumes are what the surface encloses: it is closed and oriented. Those of an
    #: open surface depend on the point that they are summed from.
    encloses_volume: bool
    #: Pairs of triangles that intersect beyond the corners and edges that they share, decided
    #: exactly. Of a job with certify.
    self_intersections: NotRequired[MeshQualitySelfIntersections]


class QualityStages(TypedDict):
    """Before and after smoothing."""

    #: Over all triangles, or, when they are more than 1 048 576, over some half a million that are
    #: spread over the mesh; the histogram's sum says how many. 0 when there are none.
    extracted: Distribution
    #: Over all triangles, or, when they are more than 1 048 576, over some half a million that are
    #: spread over the mesh; the histogram's sum says how many. 0 when there are none.
    smoothed: Distribution


class Distribution(TypedDict):
    """Over all triangles, or, when they are more than 1 048 576, over some half a million that
    are spread over the mesh; the histogram's sum says how many. 0 when there are none."""

    mean: float
    min: float
    #: Measured triangles in equal bins from 0 on; the last bin includes its end.
    histogram: Sequence[int]


class MeshFile(TypedDict):
    bytes: int
    sha256: str
    #: Where it is downloaded from.
    href: str


OrderState = Literal['waiting', 'fetching', 'meshing', 'sending', 'succeeded', 'failed', 'cancelled']


class SendTarget(TypedDict):
    pacs: str
    format: NotRequired[Literal['stl']]


class OrderRequestSource(TypedDict):
    #: The name of a configured PACS.
    pacs: str
    #: Its Study Instance UID.
    study: str
    #: Its Series Instance UID.
    series: str


class OrderRequestCallback(TypedDict):
    """As of a job. What is sent tells id, state, rule, job, created, finished and the type of
    an error: nothing of a patient."""

    url: str


class OrderRequest(TypedDict):
    source: OrderRequestSource
    #: The name of a configured rule, which says what is left out here.
    rule: NotRequired[str]
    #: As in POST /v1/jobs, without volume, priority and callback; formats is [stl] unless it is
    #: given. Where a rule is named, these members take the place of its own.
    parameters: NotRequired[Mapping[str, Any]]
    #: Where the mesh goes; may be empty.
    send: NotRequired[Sequence[SendTarget]]
    #: Jobs start in order of priority, then of age.
    priority: NotRequired[Priority]
    #: As of a job. What is sent tells id, state, rule, job, created, finished and the type of an
    #: error: nothing of a patient.
    callback: NotRequired[OrderRequestCallback]


class OrderResult(TypedDict):
    """One DICOM object for one PACS."""

    pacs: str
    format: str
    #: Of an order by labels.
    label: Optional[int]
    series_uid: str
    sop_instance_uid: str
    bytes: int
    #: The PACS has said that it stored it and finds it.
    stored: bool


class OrderSource(TypedDict):
    #: A PACS, or dimse:TITLE for what was sent to that title by C-STORE.
    pacs: str
    study: str
    series: str
    #: How many the series has, once it is known to be whole.
    instances: Optional[int]


class Order(TypedDict):
    id: str
    #: waiting until the series is there and does not grow, fetching it, meshing in its job,
    #: sending what that made; succeeded when all is stored and found.
    state: OrderState
    rule: Optional[str]
    source: OrderSource
    #: As of a job.
    parameters: Mapping[str, Any]
    #: Jobs start in order of priority, then of age.
    priority: Priority
    send: Sequence[SendTarget]
    volume: Optional[str]
    job: Optional[str]
    results: Sequence[OrderResult]
    #: How many have failed.
    attempts: int
    #: When a failed attempt is made again.
    next_attempt: Optional[str]
    created: str
    finished: Optional[str]
    #: Why the order failed, or what its last attempt met with.
    error: Optional[Problem]


class OrderList(TypedDict):
    orders: Sequence[Order]
    #: The cursor of the next page; null on the last.
    next: Optional[str]


class PacsListPacs(TypedDict):
    name: str
    last_success: Optional[str]
    last_failure: Optional[str]
    #: Of that failure, in a word.
    reason: Optional[str]


class PacsList(TypedDict):
    pacs: Sequence[PacsListPacs]


class ProblemErrors(TypedDict):
    field: str
    message: str


class ProblemChoices(TypedDict):
    #: Of the query.
    parameter: Literal['series', 'member', 'volume']
    value: str
    #: What the value stands for, for people.
    title: str


class Problem(TypedDict):
    """What went wrong (RFC 9457)."""

    #: A name that stays, for programs.
    type: Literal['urn:isomesh:problem:invalid-parameter', 'urn:isomesh:problem:digest-mismatch', 'urn:isomesh:problem:unauthorized', 'urn:isomesh:problem:forbidden', 'urn:isomesh:problem:not-found', 'urn:isomesh:problem:method-not-allowed', 'urn:isomesh:problem:not-ready', 'urn:isomesh:problem:gone', 'urn:isomesh:problem:length-required', 'urn:isomesh:problem:too-large', 'urn:isomesh:problem:uri-too-long', 'urn:isomesh:problem:unsupported-media', 'urn:isomesh:problem:range-not-satisfiable', 'urn:isomesh:problem:unusable-volume', 'urn:isomesh:problem:key-reused', 'urn:isomesh:problem:too-many-requests', 'urn:isomesh:problem:internal', 'urn:isomesh:problem:unavailable', 'urn:isomesh:problem:out-of-space', 'urn:isomesh:problem:cancelled', 'urn:isomesh:problem:request-timeout', 'urn:isomesh:problem:precondition-failed', 'urn:isomesh:problem:headers-too-large', 'urn:isomesh:problem:pacs-unreachable', 'urn:isomesh:problem:pacs-refused', 'urn:isomesh:problem:series-incomplete']
    #: The type in words.
    title: str
    #: The HTTP status.
    status: int
    #: What is wrong with this request, for people.
    detail: str
    #: The path of the request or of the job.
    instance: NotRequired[str]
    #: The parameters or members that are at fault.
    errors: NotRequired[Sequence[ProblemErrors]]
    #: The code that the query accept takes to have the same request not refused for this reason,
    #: where a person may overrule it.
    overridable: NotRequired[AcceptableNote]
    #: What can be chosen where the request leaves it open; at most a thousand.
    choices: NotRequired[Sequence[ProblemChoices]]


class SucceededJob(TypedDict):
    """A job that has succeeded: its mesh is never None."""

    #: A UUID; younger jobs have greater ones.
    id: str
    state: Literal['succeeded']
    #: What a job does at the moment, or did last.
    stage: Stage
    #: Of the whole job.
    progress: float
    #: All of them, with the defaults of those that were left out.
    parameters: CompleteJobParameters
    #: The volume's id, as in the parameters.
    volume: str
    #: Jobs start in order of priority, then of age.
    priority: Priority
    created: str
    started: str
    finished: str
    #: Milliseconds of each stage; 0 for one that has not ended yet.
    timing: Timing
    mesh: MeshSummary
    #: Null unless the job has failed.
    error: Optional[Problem]
    #: Whether the job took the mesh of an earlier job with the same volume and parameters instead
    #: of making it again; priority and callback may differ.
    reused: bool
    #: What a queued job waits for besides a worker: disk is room for its files, and it is run when
    #: there is some. Null otherwise.
    waiting_for: Optional[Literal['disk']]


class JobOptions(TypedDict, total=False):
    """The parameters of a job.

    Every member is a keyword of Client.mesh, Client.submit and Client.estimate.

    iso
        The iso-value in the volume's units, or otsu for Otsu's threshold. A sample is inside
        when its value is >= iso.

    labels
        Labels of a segmentation to mesh instead of an iso-value: their values, or all. Each
        label gets a surface of its own. Neighbouring labels share the wall between them. Values
        that are not listed are background. Vertices lie half-way between two samples. Some
        defaults differ from those of jobs with an iso-value: 10 passes, a lambda of 0.33, and
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
        Labels that consist of several sample values: the values of each label. A value may
        belong to several labels, which then overlap there. Labels that are not listed keep the
        values from the volume's file.

    scheme
        Number of tetrahedra per cell. With 5, every second cell is mirrored; the cell (0,0,0)
        is not.

    interpolation
        Position of a vertex on the edge between two samples. linear interpolates the two
        samples; midpoint puts every vertex half-way.

    passes
        Number of smoothing passes. Vertices on the surface's boundary stay where they are. For
        labels the default is 10.

    smoothing
        The smoothing method. laplacian: each pass moves every vertex towards the mean of its
        neighbours by the factor lambda; the enclosed volume shrinks. taubin: each pass does the
        same and then moves all vertices back by the factor mu, where 1/lambda + 1/mu =
        pass_band. A pass is thus two steps: they remove noise and keep shape and volume.

    lambda_
        Relaxation factor of a pass; 1 moves a vertex onto the mean of its neighbours. Null: 1
        for laplacian, 0.33 for taubin, which takes at most 0.66.

    pass_band
        For taubin: frequencies along the surface below this are kept. They range from 0
        (constant) to 2 (the sign changes from each vertex to the next).

    max_displacement_mm
        Smoothing moves no vertex farther than this from its extracted position. In millimetres.
        Null means no limit, and for labels half the smallest spacing.

    close
        Cap the surface where it meets the volume's border. Samples beyond the border then count
        as outside. The result has no boundary. Caps lie in the border, stay flat and are not
        smoothed. The rest is smoothed as if the surface were open.

    components
        Which connected components to keep; the others are dropped before smoothing. A component
        must meet all members that are given: keep chooses among those that are large enough.
        Components are ranked by their number of triangles, equal ones by their first vertex.
        Without members all are kept. Labels do not allow it.

    fill_cavities
        Remove the walls of enclosed cavities and everything that floats in them. A cavity is
        enclosed if no opening leads to it.

    crop
        Mesh only what lies in this box: its smallest and its largest corner in millimetres
        (LPS). Samples outside the box are ignored, as if the volume ended there. If the
        volume's axes are oblique, the box's extents along those axes are used. Caps close the
        surface: close is true.

    max_error_mm
        Largest distance between a file's surface and the extracted surface, measured both ways.
        In millimetres. Smoothing may use half of it. Simplification then removes as many
        triangles as the rest allows, and Draco's coordinates get as many bits as that takes.
        The error is measured on the files' own bytes: see certify, which is switched on.

    triangles
        Simplify the surface to at most this many triangles. If max_error_mm is given too, the
        limit that is reached first applies; the response names it. The resulting error is
        measured: see certify, which is switched on unless it is set to false.

    formats
        The file formats to write.

    draco
        Options of the drc format, and of the Draco streams in glb.

    normals
        Write vertex normals, weighted by the areas around them, to glb. Without normals,
        viewers shade each triangle flat or compute their own.

    distances
        Write each vertex's distance to the extracted surface to glb, in millimetres. The vertex
        attribute is _DISTANCE_MM; every level of detail has it. Values are rounded to a four
        thousandth of the largest. The page shows them as colours. The formats must include glb.

    lods
        Levels of detail in glb, as fractions of the triangles, from 1 downwards. At most 8.
        They use the extension MSFT_lod; readers that do not know it ignore them. The formats
        must include glb.

    merge
        Write the surface to glb as one primitive, or as one per label. For programs that take
        each primitive for a separate object. Otherwise there is one per hundred thousand
        triangles or so; they are written and read in parallel.

    glb_codec
        How the surface in glb is compressed. draco is KHR_draco_mesh_compression and makes
        smaller files. meshopt is EXT_meshopt_compression and is read faster. Readers must
        support the one that is used.

    space
        Directions of x and y in the files: to the patient's left and back, or to the right and
        front. z points to the head. gii is always RAS. glb has a node of its own that turns Y
        up.

    priority
        Jobs start in order of priority, then of age.

    certify
        Measure how far the files are from the extracted surface, and where they intersect
        themselves.

    callback
        Whom to tell that the job has ended, whichever way: a POST of the job, as GET gives it.
        Only addresses that the operator has listed are called. It is signed as the Standard
        Webhooks specification says (webhook-id, webhook-timestamp, webhook-signature), repeated
        until it is answered with success, for a day, and may come more than once with the same
        webhook-id.
    """

    iso: Iso
    labels: Labels
    background: Background
    label_names: LabelNames
    label_colors: LabelColors
    label_values: LabelValues
    scheme: Scheme
    interpolation: Interpolation
    passes: Passes
    smoothing: Smoothing
    lambda_: Lambda
    pass_band: PassBand
    max_displacement_mm: MaxDisplacement
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
    callback: Callback
