{{- define "isomesh.name" -}}
{{- .Release.Name | trunc 50 | trimSuffix "-" -}}
{{- end }}

{{- define "isomesh.labels" -}}
app.kubernetes.io/name: isomesh
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end }}
