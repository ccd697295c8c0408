// The tags and identifiers of DICOM's dictionary (PS3.6) that a volume needs.
#pragma once

#include <string_view>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

inline constexpr Tag kMediaStorageSopClassUid = 0x00020002;
inline constexpr Tag kMediaStorageSopInstanceUid = 0x00020003;
inline constexpr Tag kTransferSyntaxUid = 0x00020010;
inline constexpr Tag kDirectoryRecordSequence = 0x00041220;
inline constexpr Tag kSpecificCharacterSet = 0x00080005;
inline constexpr Tag kImageType = 0x00080008;
inline constexpr Tag kSopClassUid = 0x00080016;
inline constexpr Tag kSopInstanceUid = 0x00080018;
inline constexpr Tag kStudyDate = 0x00080020;
inline constexpr Tag kAcquisitionDateTime = 0x0008002A;
inline constexpr Tag kStudyTime = 0x00080030;
inline constexpr Tag kAcquisitionTime = 0x00080032;
inline constexpr Tag kContentTime = 0x00080033;
inline constexpr Tag kAccessionNumber = 0x00080050;
inline constexpr Tag kModality = 0x00080060;
inline constexpr Tag kManufacturer = 0x00080070;
inline constexpr Tag kCodeValue = 0x00080100;
inline constexpr Tag kCodingSchemeDesignator = 0x00080102;
inline constexpr Tag kCodeMeaning = 0x00080104;
inline constexpr Tag kStationName = 0x00081010;
inline constexpr Tag kManufacturerModelName = 0x00081090;
inline constexpr Tag kAnatomicRegionSequence = 0x00082218;
inline constexpr Tag kReferringPhysician = 0x00080090;
inline constexpr Tag kStudyDescription = 0x00081030;
inline constexpr Tag kSeriesDescription = 0x0008103E;
inline constexpr Tag kFrameType = 0x00089007;
inline constexpr Tag kComplexImageComponent = 0x00089208;
inline constexpr Tag kPatientName = 0x00100010;
inline constexpr Tag kPatientId = 0x00100020;
inline constexpr Tag kIssuerOfPatientId = 0x00100021;
inline constexpr Tag kPatientBirthDate = 0x00100030;
inline constexpr Tag kPatientSex = 0x00100040;
inline constexpr Tag kPatientIdentityRemoved = 0x00120062;
inline constexpr Tag kDeidentificationMethod = 0x00120063;
inline constexpr Tag kSliceThickness = 0x00180050;
inline constexpr Tag kEchoTime = 0x00180081;
inline constexpr Tag kInversionTime = 0x00180082;
inline constexpr Tag kEchoNumbers = 0x00180086;
inline constexpr Tag kSpacingBetweenSlices = 0x00180088;
inline constexpr Tag kDeviceSerialNumber = 0x00181000;
inline constexpr Tag kSoftwareVersions = 0x00181020;
inline constexpr Tag kTriggerTime = 0x00181060;
inline constexpr Tag kFlipAngle = 0x00181314;
inline constexpr Tag kDiffusionGradientSequence = 0x00189076;
inline constexpr Tag kEffectiveEchoTime = 0x00189082;
inline constexpr Tag kDiffusionBValue = 0x00189087;
inline constexpr Tag kDiffusionGradient = 0x00189089;
inline constexpr Tag kMrEchoSequence = 0x00189114;
inline constexpr Tag kMrDiffusionSequence = 0x00189117;
inline constexpr Tag kCardiacSequence = 0x00189118;
inline constexpr Tag kMrImageFrameTypeSequence = 0x00189226;
inline constexpr Tag kStudyInstanceUid = 0x0020000D;
inline constexpr Tag kSeriesInstanceUid = 0x0020000E;
inline constexpr Tag kStudyId = 0x00200010;
inline constexpr Tag kSeriesNumber = 0x00200011;
inline constexpr Tag kAcquisitionNumber = 0x00200012;
inline constexpr Tag kInstanceNumber = 0x00200013;
inline constexpr Tag kImagePosition = 0x00200032;
inline constexpr Tag kImageOrientation = 0x00200037;
inline constexpr Tag kFrameOfReferenceUid = 0x00200052;
inline constexpr Tag kTemporalPositionIdentifier = 0x00200100;
inline constexpr Tag kPositionReferenceIndicator = 0x00201040;
inline constexpr Tag kStackId = 0x00209056;
inline constexpr Tag kFrameContentSequence = 0x00209111;
inline constexpr Tag kPlanePositionSequence = 0x00209113;
inline constexpr Tag kPlaneOrientationSequence = 0x00209116;
inline constexpr Tag kTemporalPositionIndex = 0x00209128;
inline constexpr Tag kNominalTriggerDelay = 0x00209153;
inline constexpr Tag kSamplesPerPixel = 0x00280002;
inline constexpr Tag kPhotometricInterpretation = 0x00280004;
inline constexpr Tag kNumberOfFrames = 0x00280008;
inline constexpr Tag kRows = 0x00280010;
inline constexpr Tag kColumns = 0x00280011;
inline constexpr Tag kPixelSpacing = 0x00280030;
inline constexpr Tag kBitsAllocated = 0x00280100;
inline constexpr Tag kBitsStored = 0x00280101;
inline constexpr Tag kHighBit = 0x00280102;
inline constexpr Tag kPixelRepresentation = 0x00280103;
inline constexpr Tag kPixelPaddingValue = 0x00280120;
inline constexpr Tag kRescaleIntercept = 0x00281052;
inline constexpr Tag kRescaleSlope = 0x00281053;
inline constexpr Tag kRescaleType = 0x00281054;
inline constexpr Tag kModalityLutSequence = 0x00283000;
inline constexpr Tag kPixelMeasuresSequence = 0x00289110;
inline constexpr Tag kPixelValueTransformationSequence = 0x00289145;
inline constexpr Tag kSegmentationType = 0x00620001;
inline constexpr Tag kSegmentSequence = 0x00620002;
inline constexpr Tag kSegmentedPropertyCategoryCodeSequence = 0x00620003;
inline constexpr Tag kSegmentNumber = 0x00620004;
inline constexpr Tag kSegmentLabel = 0x00620005;
inline constexpr Tag kSegmentIdentificationSequence = 0x0062000A;
inline constexpr Tag kRecommendedDisplayCieLabValue = 0x0062000D;
inline constexpr Tag kSegmentedPropertyTypeCodeSequence = 0x0062000F;
inline constexpr Tag kMaximumFractionalValue = 0x0062000E;
inline constexpr Tag kReferencedSegmentNumber = 0x0062000B;
inline constexpr Tag kGridFrameOffsetVector = 0x3004000C;
inline constexpr Tag kDoseGridScaling = 0x3004000E;
inline constexpr Tag kSharedFunctionalGroups = 0x52009229;
inline constexpr Tag kPerFrameFunctionalGroups = 0x52009230;
inline constexpr Tag kFloatPixelData = 0x7FE00008;
inline constexpr Tag kDoubleFloatPixelData = 0x7FE00009;
inline constexpr Tag kPixelData = 0x7FE00010;
inline constexpr Tag kItem = 0xFFFEE000;
inline constexpr Tag kItemEnd = 0xFFFEE00D;
inline constexpr Tag kSequenceEnd = 0xFFFEE0DD;

inline constexpr std::string_view kImplicitLittleEndian = "1.2.840.10008.1.2";
inline constexpr std::string_view kExplicitLittleEndian = "1.2.840.10008.1.2.1";
inline constexpr std::string_view kDeflated = "1.2.840.10008.1.2.1.99";
inline constexpr std::string_view kExplicitBigEndian = "1.2.840.10008.1.2.2";
inline constexpr std::string_view kRle = "1.2.840.10008.1.2.5";

}  // namespace isomesh::import::dicom
