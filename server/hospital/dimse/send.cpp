#include <array>
#include <cstdio>
#include <memory>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmnet/diutil.h>

#include "server/hospital/dimse/associations.h"

namespace isomesh::dimse {
namespace {

using dimse::DimseEnd;
using dimse::DimseSent;

// Never resolved: daemon_channel.cpp has the connection.
constexpr const char* kPeersAddress = "127.0.0.1:104";
constexpr const char* kOurAddress = "isomesh";

struct EndNetwork {
  void operator()(T_ASC_Network* network) const { ASC_dropNetwork(&network); }
};
struct EndAssociation {
  void operator()(T_ASC_Association* association) const { ASC_destroyAssociation(&association); }
};
using Network = std::unique_ptr<T_ASC_Network, EndNetwork>;
using Association = std::unique_ptr<T_ASC_Association, EndAssociation>;

// DCMTK 3.6.9 requires a connection timeout; it has no effect, because daemon_channel.cpp is
// already connected.
OFCondition make_parameters(T_ASC_Parameters** parameters) {
#if PACKAGE_VERSION_NUMBER >= 369
  return ASC_createAssociationParameters(parameters, ASC_DEFAULTMAXPDU, dcmConnectionTimeout.get());
#else
  return ASC_createAssociationParameters(parameters, ASC_DEFAULTMAXPDU);
#endif
}

DimseEnd end_of(const OFCondition& condition) {
  if (condition == DIMSE_NODATAAVAILABLE || condition == DUL_READTIMEOUT) return DimseEnd::kTimeout;
  if (condition == DUL_PEERABORTEDASSOCIATION || condition == DUL_NETWORKCLOSED ||
      condition == DIMSE_SENDFAILED || condition == DIMSE_READPDVFAILED ||
      condition.code() == DULC_TCPINITERROR || condition.code() == DULC_TCPIOERROR) {
    return DimseEnd::kBroken;
  }
  return DimseEnd::kUnreadable;
}

// Why there is no association. A peer that expects TLS ends the connection, or answers with an
// alert, of which the type is that of no PDU.
DimseEnd end_of_request(const OFCondition& condition) {
  if (condition.code() == DULC_UNRECOGNIZEDPDUTYPE) return DimseEnd::kUnanswered;
  const DimseEnd end = end_of(condition);
  return end == DimseEnd::kBroken ? DimseEnd::kUnanswered : end;
}

// Proposes the object's own transfer syntax and the default one that every peer must support.
OFCondition propose(const dimse::DimseSending& order, T_ASC_Parameters* parameters) {
  std::array<const char*, 1> own = {UID_LittleEndianExplicitTransferSyntax};
  std::array<const char*, 1> plain = {UID_LittleEndianImplicitTransferSyntax};
  const OFCondition done =
      ASC_addPresentationContext(parameters, 1, order.sop_class.c_str(), own.data(), 1);
  if (done.bad()) return done;
  return ASC_addPresentationContext(parameters, 3, order.sop_class.c_str(), plain.data(), 1);
}

DimseEnd end_of_rejection(T_ASC_Parameters* parameters) {
  T_ASC_RejectParameters rejection = {};
  ASC_getRejectParameters(parameters, &rejection);
  return rejection.result == ASC_RESULT_REJECTEDTRANSIENT ? DimseEnd::kBusy : DimseEnd::kRejected;
}

T_ASC_PresentationContextID accepted_context(T_ASC_Association* association,
                                             const std::string& sop_class) {
  const auto own = ASC_findAcceptedPresentationContextID(association, sop_class.c_str(),
                                                         UID_LittleEndianExplicitTransferSyntax);
  return own != 0 ? own : ASC_findAcceptedPresentationContextID(association, sop_class.c_str());
}

DimseSent store(const dimse::DimseSending& order, T_ASC_Association* association,
                T_ASC_PresentationContextID context) {
  T_DIMSE_C_StoreRQ request = {};
  request.MessageID = association->nextMsgID++;
  std::snprintf(request.AffectedSOPClassUID, sizeof(request.AffectedSOPClassUID), "%s",
                order.sop_class.c_str());
  std::snprintf(request.AffectedSOPInstanceUID, sizeof(request.AffectedSOPInstanceUID), "%s",
                order.instance.c_str());
  request.DataSetType = DIMSE_DATASET_PRESENT;
  request.Priority = DIMSE_PRIORITY_MEDIUM;
  T_DIMSE_C_StoreRSP response = {};
  DcmDataset* detail = nullptr;
  const OFCondition done = DIMSE_storeUser(
      association, context, &request, order.file.c_str(), nullptr, nullptr, nullptr,
      DIMSE_NONBLOCKING, static_cast<int>(order.response_timeout.count()), &response, &detail);
  delete detail;
  if (done.bad()) return {.end = end_of(done), .status = 0};
  return {.end = DimseEnd::kResponded, .status = response.DimseStatus};
}

}  // namespace

DimseSent send_object(const dimse::DimseSending& order) {
  const int timeout = static_cast<int>(order.timeout.count());
  dcmSocketSendTimeout.set(timeout);
  dcmSocketReceiveTimeout.set(timeout);
  T_ASC_Network* network = nullptr;
  if (ASC_initializeNetwork(NET_REQUESTOR, 0, timeout, &network).bad()) return {};
  const Network held_network(network);
  T_ASC_Parameters* parameters = nullptr;
  OFCondition done = make_parameters(&parameters);
  if (done.good()) {
    done = ASC_setAPTitles(parameters, order.calling.c_str(), order.called.c_str(), nullptr);
  }
  if (done.good()) done = ASC_setPresentationAddresses(parameters, kOurAddress, kPeersAddress);
  if (done.good()) done = propose(order, parameters);
  if (done.bad()) return {.end = DimseEnd::kUnreadable, .status = 0};
  T_ASC_Association* association = nullptr;
  done = ASC_requestAssociation(network, parameters, &association, nullptr, nullptr, DUL_NOBLOCK,
                                timeout);
  const Association held_association(association);
  if (done == DUL_ASSOCIATIONREJECTED) return {.end = end_of_rejection(parameters), .status = 0};
  if (done.bad()) return {.end = end_of_request(done), .status = 0};
  const auto context = accepted_context(association, order.sop_class);
  if (context == 0) {
    ASC_releaseAssociation(association);
    return {.end = DimseEnd::kNotAccepted, .status = 0};
  }
  const DimseSent sent = store(order, association, context);
  if (sent.end == DimseEnd::kResponded) {
    ASC_releaseAssociation(association);
  } else {
    ASC_abortAssociation(association);
  }
  return sent;
}

}  // namespace isomesh::dimse
