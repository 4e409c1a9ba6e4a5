; Layers, selections, modes and depths. After checks.scm.

(define (place-of layer)
  (apply string-append
    (map (lambda (number) (string-append (number->string number) " "))
         (append (gimp-drawable-offsets layer) (gimp-drawable-width layer) (gimp-drawable-height layer)))))

; What went to the program last, and what came from it.
(define (keep-sent name) (with-picture "sent.png" (lambda (image layer) (keep layer name))))
(define (keep-made name) (with-picture "made.png" (lambda (image layer) (keep layer name))))

(let-program-be "real")
(with-picture "rgb.png"
  (lambda (image layer)
    (let ((mosaic (lay image layer)))
      (keep mosaic "rgb-mosaic.png")
      (fact "rgb-layers" (car (gimp-image-get-layers image)))
      (fact "rgb-position" (car (gimp-image-get-item-position image mosaic)))
      (fact "rgb-mask" (car (gimp-layer-get-mask mosaic)))
      (fact "rgb-name" (car (gimp-item-get-name mosaic)))
      (keep layer "rgb-after.png"))))

(with-picture "rgb.png"
  (lambda (image layer)
    (keep (lay image layer '(style "paint") '(tiles 40) '(seed 2147483647) '(mask "hexagon") '(grout "color")
                           '(grout-color (255 128 0)) '(evals 4000) '(size 64))
          "options-mosaic.png")))

(with-picture "rgb.png"
  (lambda (image layer)
    (fact "replaced-same-layer" (- layer (lay image layer '(new-layer 0))))
    (fact "replaced-layers" (car (gimp-image-get-layers image)))
    (keep layer "replaced.png")))

(with-picture "rgb.png"
  (lambda (image layer)
    (let* ((mosaic (lay image layer '(scale 2.5)))
           (made (car (gimp-item-get-image mosaic))))
      (fact "scaled-old-layers" (car (gimp-image-get-layers image)))
      (fact "scaled-size" (place-of mosaic))
      (fact "scaled-image-width" (car (gimp-image-width made)))
      (keep mosaic "scaled.png")
      (gimp-image-delete made))))

; At 41 px the picture is 31 px high, and drawn at 96 px it would be 73.
(with-picture "rgb.png" (lambda (image layer) (fact "odd-place" (place-of (lay image layer '(size 41))))))

; A layer that lies off the canvas's corner, in a group, between others, with transparent parts.
(with-picture "alpha.png"
  (lambda (image layer)
    (let ((group (car (gimp-layer-group-new image)))
          (above (car (gimp-layer-copy layer FALSE)))
          (below (car (gimp-layer-copy layer FALSE))))
      (gimp-image-insert-layer image group 0 0)
      (gimp-image-reorder-item image layer group 0)
      (gimp-image-insert-layer image above group 0)
      (gimp-image-insert-layer image below group 2)
      (gimp-layer-set-offsets layer -11 23)
      (let ((mosaic (lay image layer)))
        (fact "alpha-place" (place-of mosaic))
        (fact "alpha-in-group" (- group (car (gimp-item-get-parent mosaic))))
        (fact "alpha-above" (- (car (gimp-image-get-item-position image layer))
                               (car (gimp-image-get-item-position image mosaic))))
        (keep mosaic "alpha-mosaic.png")))))

; A feathered selection that reaches over the layer's edge.
(with-picture "rgb.png"
  (lambda (image layer)
    (gimp-layer-set-offsets layer 10 5)
    (gimp-context-set-feather TRUE)
    (gimp-context-set-feather-radius 9 9)
    (gimp-image-select-ellipse image CHANNEL-OP-REPLACE 40 30 100 90)
    (gimp-context-set-feather FALSE)
    (keep (car (gimp-image-get-selection image)) "selection.png")
    (let-program-be "kept")
    (let* ((bounds (gimp-drawable-mask-intersect layer))
           (mosaic (lay image layer)))
      (fact "selected-bounds" (apply string-append
        (map (lambda (number) (string-append (number->string number) " ")) (cdr bounds))))
      (fact "selected-place" (place-of mosaic))
      (fact "selected-mask-chosen" (car (gimp-layer-get-edit-mask mosaic)))
      (fact "selection-kept" (- 1 (car (gimp-selection-is-empty image))))
      (keep mosaic "selected-mosaic.png")
      (keep (car (gimp-layer-get-mask mosaic)) "selected-mask.png"))
    (let ((mosaic (lay image layer '(scale 2.0))))
      (keep mosaic "selected-scaled.png")
      (keep (car (gimp-layer-get-mask mosaic)) "selected-scaled-mask.png")
      (gimp-image-delete (car (gimp-item-get-image mosaic))))
    (lay image layer '(new-layer 0))
    (keep layer "selected-replaced.png")
    (keep-made "selected-made.png")
    (let-program-be "real")))

; A source with a mask of its own.
(with-picture "rgb.png"
  (lambda (image layer)
    (let ((own (car (gimp-layer-create-mask layer ADD-MASK-COPY))))
      (gimp-layer-add-mask layer own)
      (keep own "own-mask.png")
      (keep (car (gimp-layer-get-mask (lay image layer))) "masked-mask.png")
      (gimp-image-select-rectangle image CHANNEL-OP-REPLACE 20 10 50 40)
      (keep (car (gimp-layer-get-mask (lay image layer))) "masked-selected-mask.png")
      (gimp-selection-none image)
      (gimp-layer-set-apply-mask layer FALSE)
      (fact "mask-not-applied" (car (gimp-layer-get-mask (lay image layer)))))))

; A selection of a layer without transparency: the mosaic is clear where nothing is selected.
(with-picture "rgb.png"
  (lambda (image layer)
    (gimp-image-select-ellipse image CHANNEL-OP-REPLACE 20 20 90 70)
    (keep (car (gimp-image-get-selection image)) "opaque-selection.png")
    (let-program-be "kept")
    (lay image layer '(new-layer 0) '(size 38))
    (let-program-be "real")
    (keep layer "opaque-replaced.png")
    (keep-made "opaque-made.png")))

; Keeps what GIMP makes of a layer in an image of 8-bit sRGB.
(define (keep-plain layer name)
  (let* ((plain (car (gimp-image-new 1 1 RGB)))
         (copy (car (gimp-layer-new-from-drawable layer plain))))
    (gimp-image-insert-layer plain copy 0 0)
    (keep copy name)
    (gimp-image-delete plain)))

; Other modes and depths. The reference goes through GIMP's own conversion of the whole image.
(define (in-mode name prepare)
  (with-picture "rgb.png"
    (lambda (image layer)
      (prepare image)
      (keep-plain layer (string-append name "-source.png"))
      (let-program-be "kept")
      (let ((mosaic (lay image layer)))
        (fact (string-append name "-type") (car (gimp-drawable-type mosaic)))
        (keep mosaic (string-append name "-mosaic.png"))
        (let ((raw (car (gimp-file-load-layer RUN-NONINTERACTIVE image (in-scratch "made.png")))))
          (gimp-image-insert-layer image raw 0 0)
          (keep raw (string-append name "-reference.png"))))
      (lay image layer '(new-layer 0))
      (keep layer (string-append name "-replaced.png"))
      (let-program-be "real")
      (keep-sent (string-append name "-sent.png")))))
(in-mode "grey" (lambda (image) (gimp-image-convert-grayscale image)))
(in-mode "indexed"
  (lambda (image)
    (gimp-image-convert-indexed image CONVERT-DITHER-NONE CONVERT-PALETTE-GENERATE 12 FALSE FALSE "")))
(in-mode "deep" (lambda (image) (gimp-image-convert-precision image PRECISION-U16-GAMMA)))
(in-mode "float" (lambda (image) (gimp-image-convert-precision image PRECISION-FLOAT-LINEAR)))

(with-picture "wide.png"
  (lambda (image layer)
    (let-program-be "kept")
    (let ((mosaic (lay image layer)))
      (keep mosaic "wide-mosaic.png")
      (keep-plain mosaic "wide-mosaic-plain.png"))
    (let-program-be "real")
    (keep-sent "wide-sent.png")))

(with-picture "dot.png" (lambda (image layer) (keep (lay image layer) "dot-mosaic.png")))
(with-picture "rgb.png"
  (lambda (image layer)
    (plug-in-smalti RUN-WITH-LAST-VALS image layer "" 0 0 "" "" '(0 0 0) 0 0 0 0)
    (keep (layer-of image) "last-values.png")))
(images-left "images-after-layers")
(close-output-port facts)
