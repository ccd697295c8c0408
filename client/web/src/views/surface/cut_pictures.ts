// Brings the picture of the cut that is wanted: one request at a time, of which the next is for what is wanted last.
import type { Scope } from '../../ui/signal';

export interface CutPicturesHost<Picture> {
  // The picture is of the place that is wanted when it is called.
  fetch: () => Promise<Picture>;
  onPicture: (picture: Picture, place: string) => void;
  // The picture that is wanted failed.
  onError: (error: unknown) => void;
}

export class CutPictures<Picture> {
  private wanted = '';
  private isFetching = false;

  constructor(
    private readonly scope: Pick<Scope, 'isOver'>,
    private readonly host: CutPicturesHost<Picture>,
  ) {}

  // '' for none.
  want(place: string): void {
    this.wanted = place;
    void this.load();
  }

  private async load(): Promise<void> {
    const { wanted } = this;
    if (wanted === '' || this.isFetching || this.scope.isOver) return;
    this.isFetching = true;
    try {
      this.host.onPicture(await this.host.fetch(), wanted);
    } catch (error) {
      // That of a place before says nothing about this one, which is asked for now.
      if (wanted === this.wanted && !this.scope.isOver) this.host.onError(error);
    } finally {
      this.isFetching = false;
    }
    if (wanted !== this.wanted) void this.load();
  }
}
